// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/config/node.hpp"

namespace trifinger::config {

/// A configuration file in strict YAML: every key is known, is given once and has a value that
/// makes sense.
///
/// A file may begin with `extends: other.yml` (beside it). It then has every section of the other
/// file that it does not give itself; a section that it gives replaces the other one as a whole, so
/// that nothing, least of all a limit, is half taken from elsewhere. The other file must not extend
/// a third one.
///
/// Anchors, aliases and tags are refused: a configuration reads the same from top to bottom.
class File {
 public:
  /// Reads the file at `path`. Each of `overrides` is "fingers.height=0.3": a path of keys, list
  /// entries by number, and a value or a list in YAML. They are applied last.
  /// @throws ConfigError, SystemError if a file cannot be read.
  [[nodiscard]] static File load(const std::filesystem::path& path,
                                 const std::vector<std::string>& overrides = {});

  /// Reads `text`; `name` stands for the file in messages, and what it extends is looked for beside
  /// it.
  [[nodiscard]] static File parse(std::string_view text, const std::filesystem::path& name,
                                  const std::vector<std::string>& overrides = {});

  /// The whole configuration.
  [[nodiscard]] Node root() const;

  /// The whole configuration in YAML, in one piece: with what it extends and its overrides, without
  /// comments.
  [[nodiscard]] std::string text() const;

  /// To be called after everything was read.
  /// @throws ConfigError that names every key nobody has asked for, with the known key that looks
  /// like it.
  void reject_unknown_keys() const;

 private:
  explicit File(std::shared_ptr<const detail::Element> root);

  std::shared_ptr<const detail::Element> root_;
};

}  // namespace trifinger::config
