#include <CLI/CLI.hpp>
#include <filesystem>
#include <map>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/twofold/commands.hpp"
#include "io/v4l2/enumeration.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// /dev/videoN in the order of N.
std::vector<std::string> video_nodes() {
  std::map<int, std::string> nodes;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/dev", error)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with("video") || name.size() < 6 || name.size() > 9) continue;
    if (name.find_first_not_of("0123456789", 5) != std::string::npos) continue;
    nodes[std::stoi(name.substr(5))] = entry.path();
  }
  std::vector<std::string> paths;
  paths.reserve(nodes.size());
  for (const auto& [number, path] : nodes) paths.push_back(path);
  return paths;
}

std::string size_text(const FrameSizeEntry& size) {
  if (size.width == size.max_width && size.height == size.max_height) {
    return fmt::format("{}x{}", size.width, size.height);
  }
  return fmt::format("{}x{} to {}x{}", size.width, size.height, size.max_width, size.max_height);
}

void print_format(const FormatEntry& format) {
  fmt::print("  {}  {}{}\n", fourcc_text(format.fourcc), format.description,
             format.format ? "" : "  (not supported here)");
  for (const FrameSizeEntry& size : format.sizes) {
    std::vector<std::string> rates;
    for (const double fps : size.fps) rates.push_back(fmt::format("{:g}", fps));
    fmt::print("    {}{}{}\n", size_text(size), rates.empty() ? "" : "  fps ",
               fmt::join(rates, size.fps_range ? " to " : " "));
  }
}

void print_control(const ControlEntry& control) {
  fmt::print("  {}: {} [{}..{} step {}, default {}]{}\n", control.name,
             control.value ? std::to_string(*control.value) : "?", control.minimum, control.maximum,
             control.step, control.default_value, control.inactive ? "  (set automatically)" : "");
  if (!control.menu.empty()) fmt::print("    {}\n", fmt::join(control.menu, ", "));
}

/// Whether it is a camera.
bool print_device(V4l2Calls& calls, const std::string& path, bool all) {
  const auto device = V4l2Device::open(calls, path);
  if (!device) {
    fmt::print("{}: {}\n", path, device.error().text);
    return false;
  }
  const DeviceIdentity& identity = device->identity();
  fmt::print("{}: {} ({}, {})\n", path, identity.card, identity.driver, identity.bus);
  for (const FormatEntry& format : enumerate_formats(*device)) {
    if (all || format.format) print_format(format);
  }
  for (const ControlEntry& control : enumerate_controls(*device)) print_control(control);
  return true;
}

int list_devices(const std::vector<std::string>& asked, bool all) {
  SystemV4l2Calls calls;
  const std::vector<std::string> paths = asked.empty() ? video_nodes() : asked;
  if (paths.empty()) fmt::print("no camera: there is no /dev/video*\n");
  bool every = true;
  for (const std::string& path : paths) every &= print_device(calls, path, all);
  return asked.empty() || every ? kOk : kBadInput;
}

}  // namespace

void add_devices_command(CLI::App& app, int& exit_code) {
  auto paths = std::make_shared<std::vector<std::string>>();
  auto all = std::make_shared<bool>(false);
  CLI::App* command = app.add_subcommand("devices", "List cameras, their formats, rates and controls");
  command->add_option("DEVICE", *paths, "Only these, e.g. /dev/video0");
  command->add_flag("--all", *all, "Also formats that cannot be used");
  command->callback([paths, all, &exit_code] { exit_code = list_devices(*paths, *all); });
}

}  // namespace twofold
