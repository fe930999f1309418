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

/// A configuration file in strict YAML. Every key must be known, appear once and have a value that
/// makes sense.
///
/// A file may begin with `extends: other`, with or without ".yml". This names a file in the same
/// folder or, if there is none, in one of `folders`. The file then has every section of the other
/// file that it does not give itself. A section that it does give replaces the other one as a
/// whole. No section mixes two files, which matters most for limits. The other file may extend a
/// third one.
///
/// Anchors, aliases and tags are refused, so that a configuration can be read from top to bottom.
class File {
 public:
  /// Reads the file at `path`. Each of `overrides` looks like "fingers.height=0.3": a path of keys,
  /// with list entries by number, and a value or a list in YAML. Overrides are applied last. An
  /// extended file is looked for in the folder of `path`, then in `folders`.
  /// @throws ConfigError, SystemError if a file cannot be read.
  [[nodiscard]] static File load(const std::filesystem::path& path,
                                 const std::vector<std::string>& overrides = {},
                                 const std::vector<std::filesystem::path>& folders = {});

  /// Reads `text`, which may be from anybody: it must not extend a file, so no file is opened.
  /// Messages call it `name`.
  /// @throws ConfigError
  [[nodiscard]] static File parse(std::string_view text, const std::filesystem::path& name,
                                  const std::vector<std::string>& overrides = {});

  /// The whole configuration.
  [[nodiscard]] Node root() const;

  /// Replaces the value that `node` of this configuration has by a text. Messages about it still
  /// name the place where it was written. Nodes that were found before keep the old value.
  void replace(const Node& node, std::string text);

  /// The whole configuration as one YAML text, with the extended files and the overrides, without
  /// comments.
  [[nodiscard]] std::string text() const;

  /// The value of every key by its path, for example {"fingers.height", "0.283"}. Values are
  /// written in one way: numbers have no unit, and a list of equal numbers becomes one number. A
  /// list of sections has no value.
  [[nodiscard]] std::map<std::string, std::string> values() const;

  /// A value that was read, and what its reader allows.
  struct Key {
    std::string path;     ///< "contact.tip_friction"
    std::string value;    ///< The value as written. A list of equal numbers is shown as one number.
    std::string allowed;  ///< "0.001 to 5"; holds for each entry of a list.
  };
  /// Everything that was read so far, in the order of the file.
  [[nodiscard]] std::vector<Key> keys() const;

  /// Call this after everything was read.
  /// @throws ConfigError that names every key nobody has asked for, with the most similar known
  /// key.
  void reject_unknown_keys() const;

 private:
  explicit File(std::shared_ptr<const detail::Element> root);
  [[nodiscard]] static File overridden(detail::Element root,
                                       const std::vector<std::string>& overrides);

  std::shared_ptr<const detail::Element> root_;
};

}  // namespace trifinger::config
