# SPDX-License-Identifier: BSD-3-Clause


class DeviceNotConnectedError(ConnectionError):
    pass


class DeviceAlreadyConnectedError(ConnectionError):
    pass
