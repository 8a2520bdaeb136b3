#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

#include "geometry/se3.hpp"

namespace twofold {

/// A node of a YAML file that knows its file and the path of keys that led to it, for messages.
class YamlNode {
 public:
  /// Parses a file. A first line "%YAML:1.0", as OpenCV and EuRoC write it, is tolerated. Throws IoError.
  [[nodiscard]] static YamlNode load(const std::filesystem::path& file);

  [[nodiscard]] bool is_map() const { return node_.IsMap(); }
  [[nodiscard]] bool has(const std::string& key) const;
  /// All below throw IoError, naming file, line and key, when something is missing or of another form.
  [[nodiscard]] YamlNode at(const std::string& key) const;
  [[nodiscard]] double number() const;
  [[nodiscard]] int integer() const;
  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::vector<double> numbers() const;
  [[nodiscard]] std::vector<double> numbers(std::size_t count) const;
  [[nodiscard]] std::vector<YamlNode> items() const;
  /// A rigid motion from 16 numbers, or four rows of four, or EuRoC's {rows, cols, data}.
  [[nodiscard]] SE3 rigid_motion() const;
  void expect_keys(std::initializer_list<const char*> known) const;
  [[noreturn]] void fail(const std::string& problem) const;

 private:
  YamlNode(std::filesystem::path file, std::string key, const YAML::Node& node)
      : file_(std::move(file)), key_(std::move(key)), node_(node) {}

  std::filesystem::path file_;
  std::string key_;
  YAML::Node node_;
};

}  // namespace twofold
