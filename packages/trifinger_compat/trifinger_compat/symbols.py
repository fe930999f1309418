# SPDX-License-Identifier: BSD-3-Clause
"""What programs of the original stack use, and what becomes of it here.

The command `trifinger compat-check`, the tests and docs/coming_from_the_original.md have this one
table. `path` says where a name is found: "module:attribute.attribute". Members of objects belong
to a class, such as "trifinger_simulation:TriFingerPlatform.append_desired_action", also those that
only an instance has.
"""

from dataclasses import dataclass

SAME, DIFFERS, MISSING = "works", "works, differs", "does not work"

_TS = "trifinger_simulation"
_P = f"{_TS}:TriFingerPlatform"
_SF = f"{_TS}:SimFinger"
_L = f"{_TS}.trifingerpro_limits:"
_MC = f"{_TS}.tasks.move_cube:"
_MCT = f"{_TS}.tasks.move_cube_on_trajectory:"
_RD = f"{_TS}.tasks.rearrange_dice:"
_CE = f"{_TS}.gym_wrapper.envs.cube_env:"
_VO = f"{_TS}.visual_objects:"
_FTD = f"{_TS}.finger_types_data:"
_TP = f"{_TS}.trifinger_platform:"
_RI = "robot_interfaces"
_RF = "robot_fingers"
_K = "robot_properties_fingers:Kinematics"
_OT = "trifinger_object_tracking"
_RLDS = "trifinger_rl_datasets"

_DRAWN_BY_NOBODY = "markers are kept, and drawn by nobody; `trifinger view` shows goals"
_OPAQUE = "markers, objects, cameras and some calls of PyBullet take it; see 'PyBullet'"
_CAMERAS = "the robot's configuration has the cameras (docs/cameras.md); read them with a Frontend"
_NO_DRIVER = "no driver for this robot; examples/05 and `trifinger new robot` show how to write one"
_OWN_FILE = "reads the original's file, which no back-end takes; see 'The real robot'"
_OWN_CONFIGURATION = "takes a configuration of this project, not the original's"
_OWN_PACKAGE = "only with trifinger_rl_datasets itself, see 'Data sets'; else NotImplementedError"


@dataclass(frozen=True)
class Symbol:
    """A name of the original."""

    sites: int  # how often programs use it
    name: str  # as facts and documents call it
    path: str  # where it is here
    verdict: str = SAME
    note: str = ""


def _all(sites: int, *names: tuple[str, str] | tuple[str, str, str, str]) -> list[Symbol]:
    return [Symbol(sites, *name) for name in names]


# In the order of use: 160 names are 92 % of all places.
RANKED: list[Symbol] = [
    *_all(235, ("P.simfinger", f"{_P}.simfinger")),
    *_all(115, ("mc.sample_goal", f"{_MC}sample_goal")),
    *_all(109, ("Goal.position", f"{_MC}Pose.position")),
    *_all(106, ("mc.Pose", f"{_MC}Pose")),
    *_all(85, ("RO.position", f"{_TS}:Observation.position")),
    *_all(78, ("P.get_camera_observation", f"{_P}.get_camera_observation")),
    *_all(
        71, ("Pose.position", f"{_MC}Pose.position"), ("mc.Pose.from_dict", f"{_MC}Pose.from_dict")
    ),
    *_all(65, ("Goal.orientation", f"{_MC}Pose.orientation")),
    *_all(59, ("P.append_desired_action", f"{_P}.append_desired_action")),
    *_all(
        56,
        (
            "SF.reset_finger_positions_and_velocities",
            f"{_SF}.reset_finger_positions_and_velocities",
        ),
    ),
    *_all(54, ("P.get_robot_observation", f"{_P}.get_robot_observation")),
    *_all(50, ("CO.object_pose", f"{_TS}:TriCameraObjectObservation.object_pose")),
    *_all(48, ("P.Action", f"{_P}.Action")),
    *_all(47, ("ts.TriFingerPlatform", _P)),
    *_all(46, ("L.robot_torque.default", f"{_L}robot_torque.default")),
    *_all(44, ("L.robot_position.default", f"{_L}robot_position.default")),
    *_all(
        43,
        ("Pose.orientation", f"{_MC}Pose.orientation"),
        ("mc.episode_length", f"{_MC}episode_length"),
    ),
    *_all(41, ("SF._pybullet_client_id", f"{_SF}._pybullet_client_id", DIFFERS, _OPAQUE)),
    *_all(
        40, ("CO.filtered_object_pose", f"{_TS}:TriCameraObjectObservation.filtered_object_pose")
    ),
    *_all(
        39,
        ("CO.cameras", f"{_TS}:TriCameraObservation.cameras"),
        ("mc.evaluate_state", f"{_MC}evaluate_state"),
    ),
    *_all(38, ("mc._CUBE_WIDTH", f"{_MC}_CUBE_WIDTH")),
    *_all(37, ("RO.velocity", f"{_TS}:Observation.velocity")),
    *_all(35, ("ri.trifinger.Action", f"{_RI}:trifinger.Action")),
    *_all(34, ("mct.EPISODE_LENGTH", f"{_MCT}EPISODE_LENGTH")),
    *_all(31, ("RO.torque", f"{_TS}:Observation.torque"), ("SF.Action", f"{_SF}.Action")),
    *_all(
        29,
        ("S.robot_torque.gym", f"{_P}.spaces.robot_torque.gym"),
        ("mc._ARENA_RADIUS", f"{_MC}_ARENA_RADIUS"),
    ),
    *_all(
        28,
        ("CE.ActionType.POSITION", f"{_CE}ActionType.POSITION"),
        ("L.robot_position.high", f"{_L}robot_position.high"),
        ("L.robot_position.low", f"{_L}robot_position.low"),
        ("L.robot_torque.high", f"{_L}robot_torque.high"),
        ("L.robot_torque.low", f"{_L}robot_torque.low"),
        ("rf.TriFingerPlatformFrontend", f"{_RF}:TriFingerPlatformFrontend"),
    ),
    *_all(
        27,
        ("P.forward_kinematics", f"{_P}.forward_kinematics"),
        ("SF.append_desired_action", f"{_SF}.append_desired_action"),
    ),
    *_all(
        26,
        ("L.object_position.high", f"{_L}object_position.high"),
        ("L.object_position.low", f"{_L}object_position.low"),
        ("L.robot_velocity.high", f"{_L}robot_velocity.high"),
        ("L.robot_velocity.low", f"{_L}robot_velocity.low"),
    ),
    *_all(25, ("SF.get_observation", f"{_SF}.get_observation")),
    *_all(
        24,
        ("CE.ActionType.TORQUE", f"{_CE}ActionType.TORQUE"),
        ("rd.EPISODE_LENGTH", f"{_RD}EPISODE_LENGTH"),
    ),
    *_all(
        23,
        ("PlatformLog.get_last_timeindex", f"{_RF}:TriFingerPlatformLog.get_last_timeindex"),
        ("mc._CUBOID_SIZE", f"{_MC}_CUBOID_SIZE"),
    ),
    *_all(22, ("RO.tip_force", f"{_TS}:Observation.tip_force")),
    *_all(21, ("S", f"{_P}.spaces"), ("SF.max_motor_torque", f"{_SF}.max_motor_torque")),
    *_all(
        20,
        ("L.object_orientation.high", f"{_L}object_orientation.high"),
        ("L.object_orientation.low", f"{_L}object_orientation.low"),
        ("ts.Action", f"{_TS}:Action"),
    ),
    *_all(
        19,
        ("CO.cameras[].timestamp", f"{_TS}:CameraObservation.timestamp"),
        ("mc.validate_goal", f"{_MC}validate_goal"),
    ),
    *_all(
        18,
        ("SF.pinocchio_utils", f"{_SF}.pinocchio_utils"),
        ("ts.SimFinger", _SF),
        ("vo.CubeMarker", f"{_VO}CubeMarker", DIFFERS, _DRAWN_BY_NOBODY),
    ),
    *_all(
        16,
        ("P.get_timestamp_ms", f"{_P}.get_timestamp_ms"),
        ("PlatformLog.get_first_timeindex", f"{_RF}:TriFingerPlatformLog.get_first_timeindex"),
        ("S.robot_position.gym", f"{_P}.spaces.robot_position.gym"),
        ("mc.Pose.from_json", f"{_MC}Pose.from_json"),
        ("mc._max_height", f"{_MC}_max_height"),
    ),
    *_all(15, ("P.get_current_timeindex", f"{_P}.get_current_timeindex")),
    *_all(
        14,
        ("CE.RandomInitializer", f"{_CE}RandomInitializer"),
        ("P.get_object_pose", f"{_P}.get_object_pose"),
        ("mc.random", f"{_MC}random"),
    ),
    *_all(
        13,
        ("Goal.to_dict", f"{_MC}Pose.to_dict"),
        ("Kinematics()", _K),
        ("mct.get_active_goal", f"{_MCT}get_active_goal"),
    ),
    *_all(
        12,
        ("CE.ActionType.TORQUE_AND_POSITION", f"{_CE}ActionType.TORQUE_AND_POSITION"),
        ("K.inverse_kinematics", f"{_K}.inverse_kinematics"),
        ("L.n_fingers", f"{_L}n_fingers"),
        ("Marker.set_state", f"{_VO}Marker.set_state", DIFFERS, _DRAWN_BY_NOBODY),
        ("P.wait_until_timeindex", f"{_RF}:TriFingerPlatformFrontend.wait_until_timeindex"),
    ),
    *_all(
        11,
        ("ftd.get_finger_urdf", f"{_FTD}get_finger_urdf"),
        ("rd.sample_goal", f"{_RD}sample_goal"),
        ("rf.TriFingerPlatformLog", f"{_RF}:TriFingerPlatformLog"),
        (
            "rf.TriFingerPlatformWithObjectFrontend",
            f"{_RF}:TriFingerPlatformWithObjectFrontend",
        ),
    ),
    *_all(
        10,
        ("S.robot_position.default", f"{_P}.spaces.robot_position.default"),
        ("mc.InvalidGoalError", f"{_MC}InvalidGoalError"),
        ("rf.TriFingerPlatformWithObjectLog", f"{_RF}:TriFingerPlatformWithObjectLog"),
    ),
    *_all(9, ("mc._min_height", f"{_MC}_min_height"), ("robot_fingers", f"{_RF}:")),
    *_all(
        8,
        ("K.forward_kinematics", f"{_K}.forward_kinematics"),
        ("K.inverse_kinematics_one_finger", f"{_K}.inverse_kinematics_one_finger"),
        ("cam.utils.convert_image", "trifinger_cameras.utils:convert_image"),
        ("mc.get_cube_corner_positions", f"{_MC}get_cube_corner_positions"),
    ),
    *_all(
        7,
        ("SF._get_latest_observation", f"{_SF}._get_latest_observation"),
        (
            "TriFingerDatasetEnv.get_dataset",
            f"{_RLDS}:TriFingerDatasetEnv.get_dataset",
            DIFFERS,
            _OWN_PACKAGE,
        ),
        ("mc._max_cube_com_distance_to_center", f"{_MC}_max_cube_com_distance_to_center"),
        ("mct.sample_goal", f"{_MCT}sample_goal"),
    ),
    *_all(
        6,
        ("Action.position", f"{_TS}:Action.position"),
        ("Goal.to_json", f"{_MC}Pose.to_json"),
        ("L.object_orientation.default", f"{_L}object_orientation.default"),
        ("SF.kinematics", f"{_SF}.kinematics"),
        ("mc._base_orientations", f"{_MC}_base_orientations"),
        ("mct.INITIAL_CUBE_POSITION", f"{_MCT}INITIAL_CUBE_POSITION"),
        ("mct.Position", f"{_MCT}Position"),
        ("mct.Trajectory", f"{_MCT}Trajectory"),
        ("ot.py_tricamera_types.LogReader", f"{_OT}.py_tricamera_types:LogReader"),
        ("rd.Goal", f"{_RD}Goal"),
        ("rd.evaluate_state", f"{_RD}evaluate_state"),
        ("rd.generate_goal_mask", f"{_RD}generate_goal_mask"),
        ("rd.seed", f"{_RD}seed"),
        ("rd.validate_goal", f"{_RD}validate_goal"),
    ),
    *_all(
        5,
        ("Action.torque", f"{_TS}:Action.torque"),
        ("CO.cameras[].image", f"{_TS}:CameraObservation.image"),
        ("P.get_desired_action", f"{_P}.get_desired_action"),
        ("P.store_action_log", f"{_P}.store_action_log"),
        ("SF.number_of_fingers", f"{_SF}.number_of_fingers"),
        ("robot_interfaces", f"{_RI}:"),
        ("vo.CuboidMarker", f"{_VO}CuboidMarker", DIFFERS, _DRAWN_BY_NOBODY),
    ),
    *_all(
        4,
        ("ObjectType.COLORED_CUBE", f"{_TP}ObjectType.COLORED_CUBE"),
        ("P.spaces", f"{_P}.spaces"),
        ("S.robot_position", f"{_P}.spaces.robot_position"),
        ("SF.finger_urdf_path", f"{_SF}.finger_urdf_path"),
        ("ftd.get_valid_finger_types", f"{_FTD}get_valid_finger_types"),
        ("mct.GOAL_DIFFICULTY", f"{_MCT}GOAL_DIFFICULTY"),
        ("mct.seed", f"{_MCT}seed"),
        ("mct.validate_goal", f"{_MCT}validate_goal"),
        ("ri.trifinger", f"{_RI}:trifinger"),
        ("rlds.PolicyBase", f"{_RLDS}:PolicyBase"),
        (
            "rrc_2022_datasets.utils.get_pose_from_keypoints",
            "rrc_2022_datasets.utils:get_pose_from_keypoints",
        ),
        ("vo.Marker", f"{_VO}Marker", DIFFERS, _DRAWN_BY_NOBODY),
    ),
    *_all(
        3,
        ("CE.CubeEnv", f"{_CE}CubeEnv"),
        ("ObjectType.DICE", f"{_TP}ObjectType.DICE"),
        ("P.wait_until_time_index", f"{_RF}:TriFingerPlatformFrontend.wait_until_time_index"),
        ("SF.position_gains", f"{_SF}.position_gains"),
        ("SF.velocity_gains", f"{_SF}.velocity_gains"),
        ("mct.evaluate_state", f"{_MCT}evaluate_state"),
    ),
    *_all(
        2,
        ("Action.position_kd", f"{_TS}:Action.position_kd"),
        ("Action.position_kp", f"{_TS}:Action.position_kp"),
        ("CE.FixedInitializer", f"{_CE}FixedInitializer"),
        ("LogReader.data", f"{_OT}.py_tricamera_types:LogReader.data"),
        ("P.camera_rate_fps", f"{_P}.camera_rate_fps"),
        ("P.enable_cameras", f"{_P}.enable_cameras"),
        ("P.get_applied_action", f"{_P}.get_applied_action"),
        ("S.object_orientation.default", f"{_P}.spaces.object_orientation.default"),
        ("S.object_position.default", f"{_P}.spaces.object_position.default"),
        ("SF._set_desired_action", f"{_SF}._set_desired_action"),
        ("SF._step_simulation", f"{_SF}._step_simulation"),
        ("cam.py_tricamera_types.LogReader", "trifinger_cameras.py_tricamera_types:LogReader"),
        ("ftd.finger_types_data", f"{_FTD}finger_types_data"),
        ("ftd.get_number_of_fingers", f"{_FTD}get_number_of_fingers"),
        ("mc._CUBOID_HALF_SIZE", f"{_MC}_CUBOID_HALF_SIZE"),
        ("mct.FIRST_GOAL_DURATION", f"{_MCT}FIRST_GOAL_DURATION"),
        ("mct.GOAL_DURATION", f"{_MCT}GOAL_DURATION"),
        ("rlds.PolicyConfig", f"{_RLDS}:PolicyConfig"),
        ("rlds.TriFingerDatasetEnv", f"{_RLDS}:TriFingerDatasetEnv", DIFFERS, _OWN_PACKAGE),
        ("vo.SphereMaker", f"{_VO}SphereMaker", DIFFERS, _DRAWN_BY_NOBODY),
    ),
    *_all(
        1,
        ("CollObj.get_state", f"{_TS}.collision_objects:Cube.get_state"),
        ("K.compute_jacobian", f"{_K}.compute_jacobian"),
        ("P.get_time_step", f"{_P}.get_time_step"),
        ("S.robot_position.gym.high", f"{_P}.spaces.robot_position.gym.high"),
        ("S.robot_position.gym.low", f"{_P}.spaces.robot_position.gym.low"),
        ("SF.time_step_s", f"{_SF}.time_step_s"),
        (
            "rlds.evaluate_sim.load_policy_class",
            f"{_RLDS}.evaluate_sim:load_policy_class",
        ),
        ("vo.CubeMarker2", f"{_VO}CubeMarker2", DIFFERS, _DRAWN_BY_NOBODY),
    ),
]

# The other names that programs use: 8 % of all places.
OTHERS: list[Symbol] = [
    *_all(62, ("P.cube", f"{_P}.cube")),
    *_all(56, ("SF.finger_id", f"{_SF}.finger_id", DIFFERS, _OPAQUE)),
    *_all(34, ("SF.pybullet_link_indices", f"{_SF}.pybullet_link_indices")),
    *_all(20, ("SF.pybullet_tip_link_indices", f"{_SF}.pybullet_tip_link_indices")),
    *_all(
        10,
        ("ts.camera.TriFingerCameras", f"{_TS}.camera:TriFingerCameras"),
        ("ts.sample.random_joint_positions", f"{_TS}.sample:random_joint_positions"),
    ),
    *_all(
        7,
        (
            "ot.py_lightblue_segmenter.segment_image",
            f"{_OT}.py_lightblue_segmenter:segment_image",
            DIFFERS,
            "found by colour, not by a trained classifier",
        ),
    ),
    *_all(6, ("ts.camera.CameraParameters", f"{_TS}.camera:CameraParameters")),
    *_all(5, ("ts.collision_objects.Block", f"{_TS}.collision_objects:Block")),
    *_all(
        4,
        ("ot.py_tricamera_types.CubeVisualizer", f"{_OT}.py_tricamera_types:CubeVisualizer"),
        ("ri.finger", f"{_RI}:finger"),
        ("ts.camera.load_camera_parameters", f"{_TS}.camera:load_camera_parameters"),
        (
            "ts.drivers.create_single_finger_backend",
            "rrc_simulation.drivers:create_single_finger_backend",
        ),
        (
            "ts.drivers.create_trifinger_backend",
            "rrc_simulation.drivers:create_trifinger_backend",
        ),
    ),
    *_all(
        3,
        ("cam.camera.cvMat", "trifinger_cameras.camera:cvMat"),
        ("ot.py_object_tracker.Data", f"{_OT}.py_object_tracker:Data"),
        ("ot.py_object_tracker.SimulationBackend", f"{_OT}.py_object_tracker:SimulationBackend"),
        ("Frontend.append_desired_action", f"{_RI}:trifinger.Frontend.append_desired_action"),
        ("Frontend.get_observation", f"{_RI}:trifinger.Frontend.get_observation"),
        ("Frontend.wait_until_time_index", f"{_RI}:trifinger.Frontend.wait_until_time_index"),
    ),
    *_all(
        2,
        ("ot.py_object_tracker.Frontend", f"{_OT}.py_object_tracker:Frontend"),
        ("ts.camera.Camera", f"{_TS}.camera:Camera"),
        ("P.tricamera", f"{_P}.tricamera"),
        ("SF.pybullet_joint_indices", f"{_SF}.pybullet_joint_indices"),
    ),
    *_all(
        1,
        ("cam.tricamera.Backend", "trifinger_cameras.py_tricamera_types:Backend"),
        (
            "cam.tricamera.PyBulletTriCameraDriver",
            "trifinger_cameras.py_tricamera_types:PyBulletTriCameraDriver",
        ),
        ("ot.py_object_tracker.FakeBackend", f"{_OT}.py_object_tracker:FakeBackend"),
        ("ot.py_object_tracker.ObjectPose", f"{_OT}.py_object_tracker:ObjectPose"),
        ("ot.py_object_tracker.get_model_by_name", f"{_OT}.py_object_tracker:get_model_by_name"),
        ("Backend.wait_until_terminated", f"{_RI}:trifinger.Backend.wait_until_terminated"),
        ("Logger.start", f"{_RI}:trifinger.Logger.start"),
        ("cam.tricamera.MultiProcessData", "trifinger_cameras.py_tricamera_types:MultiProcessData"),
        ("ot.py_tricamera_types.Frontend", f"{_OT}.py_tricamera_types:Frontend"),
        ("P._camera_observation_t", f"{_P}._camera_observation_t"),
        ("P._delayed_camera_observation", f"{_P}._delayed_camera_observation"),
        ("P._get_current_camera_observation", f"{_P}._get_current_camera_observation"),
        ("CameraArray.cameras", f"{_TS}.camera:CameraArray.cameras"),
        (
            "ts.camera.create_trifinger_camera_array_from_config",
            f"{_TS}.camera:create_trifinger_camera_array_from_config",
        ),
    ),
]

# Names that no program was seen to use, and that take nothing, or not all that the original takes.
REFUSED: list[Symbol] = _all(
    0,
    (
        "ts.collision_objects.import_mesh",
        f"{_TS}.collision_objects:import_mesh",
        MISSING,
        "there are boxes alone; use a Cuboid of the same size",
    ),
    *(
        (f"cam.camera.{name}", f"trifinger_cameras.camera:{name}", MISSING, _CAMERAS)
        for name in ("OpenCVDriver", "PylonDriver")
    ),
    (
        "cam.tricamera.TriCameraDriver",
        "trifinger_cameras.py_tricamera_types:TriCameraDriver",
        MISSING,
        _CAMERAS,
    ),
    (
        "ot.py_tricamera_types.TriCameraObjectTrackerDriver",
        f"{_OT}.py_tricamera_types:TriCameraObjectTrackerDriver",
        MISSING,
        _CAMERAS,
    ),
    (
        "ot.py_object_tracker.CubeDetector",
        f"{_OT}.py_object_tracker:CubeDetector",
        MISSING,
        "use trifinger.tracking.Tracker",
    ),
    *(
        (f"rf.create_{name}_backend", f"{_RF}:create_{name}_backend", MISSING, _NO_DRIVER)
        for name in ("one_joint", "two_joint", "solo_eight")
    ),
    *(
        (f"rf.create_{name}_backend", f"{_RF}:create_{name}_backend", DIFFERS, _OWN_CONFIGURATION)
        for name in ("trifinger", "real_finger")
    ),
    *(
        (f"rf.{name}Config", f"{_RF}:{name}Config", DIFFERS, _OWN_FILE)
        for name in ("TriFinger", "Finger", "OneJoint", "TwoJoint", "SoloEight")
    ),
    (
        "rrc_2022_datasets.TriFingerDatasetEnv",
        "rrc_2022_datasets:TriFingerDatasetEnv",
        DIFFERS,
        "only with rrc_2022_datasets itself, which was not tried; else NotImplementedError",
    ),
)

SYMBOLS = RANKED + OTHERS + REFUSED

PACKAGES = (
    "trifinger_simulation",
    "rrc_simulation",
    "robot_interfaces",
    "robot_fingers",
    "trifinger_cameras",
    "trifinger_object_tracking",
    "robot_properties_fingers",
    "trifinger_rl_datasets",
    "rrc_2022_datasets",
    "ament_index_python",
)
