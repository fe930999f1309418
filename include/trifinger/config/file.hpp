// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "trifinger/config/node.hpp"

namespace trifinger::config {

/// A configuration file in strict YAML: every key is known, is given once and has a value that
/// makes sense.
///
/// A file may begin with `extends: other`, with or without ".yml": the file of that name beside it,
/// or else in one of the `folders` that it is read with. It then has every section of the other
/// file that it does not give itself; a section that it gives replaces the other one as a whole, so
/// that nothing, least of all a limit, is half taken from elsewhere. The other file may extend a
/// third one in turn.
///
/// Anchors, aliases and tags are refused: a configuration reads the same from top to bottom.
class File {
 public:
  /// Reads the file at `path`. Each of `overrides` is "fingers.height=0.3": a path of keys, list
  /// entries by number, and a value or a list in YAML. They are applied last. What a file extends
  /// is looked for beside it, then in `folders`.
  /// @throws ConfigError, SystemError if a file cannot be read.
  [[nodiscard]] static File load(const std::filesystem::path& path,
                                 const std::vector<std::string>& overrides = {},
                                 const std::vector<std::filesystem::path>& folders = {});

  /// Reads `text`; `name` stands for the file in messages, and what it extends is looked for beside
  /// it, then in `folders`.
  [[nodiscard]] static File parse(std::string_view text, const std::filesystem::path& name,
                                  const std::vector<std::string>& overrides = {},
                                  const std::vector<std::filesystem::path>& folders = {});

  /// The whole configuration.
  [[nodiscard]] Node root() const;

  /// The whole configuration in YAML, in one piece: with what it extends and its overrides, without
  /// comments.
  [[nodiscard]] std::string text() const;

  /// The value of every key by its path, as in {"fingers.height", "0.283"}, written in one way:
  /// numbers have no unit, a list of equal numbers is one of them. A list of sections has none.
  [[nodiscard]] std::map<std::string, std::string> values() const;

  /// To be called after everything was read.
  /// @throws ConfigError that names every key nobody has asked for, with the known key that looks
  /// like it.
  void reject_unknown_keys() const;

 private:
  explicit File(std::shared_ptr<const detail::Element> root);

  std::shared_ptr<const detail::Element> root_;
};

}  // namespace trifinger::config
