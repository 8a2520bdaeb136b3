#include "io/files/yaml_node.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"

namespace twofold {

YamlNode YamlNode::load(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream || !std::filesystem::is_regular_file(file)) throw IoError(file, "no such calibration file");
  std::stringstream text;
  text << stream.rdbuf();
  std::string content = text.str();
  if (content.starts_with("%YAML:")) content[0] = '#';  // not a valid directive; a comment keeps line numbers
  try {
    YAML::Node root = YAML::Load(content);
    if (!root.IsMap()) throw IoError(file, "is not a YAML file of keys and values");
    return {file, "", root};
  } catch (const YAML::Exception& e) {
    throw IoError(file, e.mark.line + 1, e.msg);
  }
}

void YamlNode::fail(const std::string& problem) const {
  const std::string subject = key_.empty() ? "" : fmt::format("key '{}' ", key_);
  throw IoError(file_, std::max(0, node_.Mark().line) + 1, subject + problem);
}

bool YamlNode::has(const std::string& key) const {
  return node_.IsMap() && node_[key].IsDefined() && !node_[key].IsNull();
}

YamlNode YamlNode::at(const std::string& key) const {
  const std::string path = key_.empty() ? key : key_ + "." + key;
  if (!has(key)) throw IoError(file_, fmt::format("key '{}' is missing", path));
  return {file_, path, node_[key]};
}

std::string YamlNode::text() const {
  if (!node_.IsScalar()) fail("is not a single value");
  return node_.Scalar();
}

double YamlNode::number() const {
  const auto value = to_number(text());
  if (!value) fail(fmt::format("is '{}', not a finite number", text()));
  return *value;
}

int YamlNode::integer() const {
  const auto value = to_integer(text());
  if (!value || std::abs(*value) > 1'000'000'000) fail(fmt::format("is '{}', not an integer", text()));
  return static_cast<int>(*value);
}

std::vector<YamlNode> YamlNode::items() const {
  if (!node_.IsSequence()) fail("is not a list");
  std::vector<YamlNode> items;
  for (std::size_t i = 0; i < node_.size(); ++i) {
    items.push_back(YamlNode(file_, fmt::format("{}[{}]", key_, i), node_[i]));
  }
  return items;
}

std::vector<double> YamlNode::numbers() const {
  std::vector<double> values;
  for (const YamlNode& item : items()) values.push_back(item.number());
  return values;
}

std::vector<double> YamlNode::numbers(std::size_t count) const {
  auto values = numbers();
  if (values.size() != count) fail(fmt::format("has {} numbers, {} are needed", values.size(), count));
  return values;
}

SE3 YamlNode::rigid_motion() const {
  if (node_.IsMap()) return at("data").rigid_motion();
  std::vector<double> values;
  for (const YamlNode& item : items()) {
    const auto row = item.node_.IsSequence() ? item.numbers() : std::vector<double>{item.number()};
    values.insert(values.end(), row.begin(), row.end());
  }
  if (values.size() != 16) fail(fmt::format("has {} numbers, a 4x4 matrix has 16", values.size()));
  const Matrix4 T = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
  const Matrix3 R = T.topLeftCorner<3, 3>();
  constexpr double kTolerance = 1e-3;  // files carry six to twelve digits
  if ((R * R.transpose() - Matrix3::Identity()).norm() > kTolerance || R.determinant() < 0 ||
      (T.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() > kTolerance) {
    fail("is not a rotation and a translation");
  }
  return {R, Vector3(T.topRightCorner<3, 1>())};
}

void YamlNode::expect_keys(std::initializer_list<const char*> known) const {
  if (!node_.IsMap()) fail("is not a set of keys and values");
  for (const auto& entry : node_) {
    const std::string key = entry.first.Scalar();
    if (std::find(known.begin(), known.end(), key) == known.end())
      fail(fmt::format("has an unknown key '{}'", key));
  }
}

}  // namespace twofold
