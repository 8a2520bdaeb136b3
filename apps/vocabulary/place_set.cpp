#include "apps/vocabulary/place_set.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include <fmt/format.h>

#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/open_source.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

PlaceSet load_images(const fs::path& folder, int every, const Vocabulary& vocabulary) {
  PlaceSet set;
  set.rig.kind = SensorKind::kMono;
  PlaceDescriber describer(set.rig, {});
  const std::vector<fs::path> files = list_images(folder);
  FrameImages images;
  for (std::size_t i = 0; i < files.size(); i += static_cast<std::size_t>(every)) {
    images.left.build(read_grey_image(files[i]));
    set.places.push_back({describer.describe(images, vocabulary), std::nullopt});
  }
  return set;
}

std::optional<SE3> pose_at(const Trajectory& truth, std::int64_t t_ns) {
  const auto after = std::lower_bound(truth.begin(), truth.end(), t_ns,
                                      [](const TimedPose& pose, std::int64_t t) { return pose.t_ns < t; });
  std::optional<SE3> best;
  std::int64_t best_ns = 20'000'000;
  for (auto it = after == truth.begin() ? after : after - 1; it != truth.end() && it <= after; ++it) {
    const std::int64_t distance = std::abs(it->t_ns - t_ns);
    if (distance > best_ns) continue;
    best_ns = distance;
    best = it->T_w_c;
  }
  return best;
}

PlaceSet load_source(const std::string& text, int every, const Vocabulary& vocabulary) {
  const auto source = open_source(text);
  PlaceSet set;
  set.rig = source->rig();
  PlaceDescriber describer(set.rig, {});
  Frame frame;
  FrameImages images;
  FrameStatus status;
  while ((status = source->next(frame)) == FrameStatus::kFrame) {
    if (frame.index % every != 0) continue;
    images.left.build(frame.left);
    if (set.rig.kind == SensorKind::kStereo) images.right.build(frame.right);
    images.depth = frame.depth;
    set.places.push_back(
        {describer.describe(images, vocabulary), pose_at(source->ground_truth(), frame.t_ns)});
  }
  if (status == FrameStatus::kError) throw IoError(source->error());
  return set;
}

}  // namespace

PlaceSet load_place_set(const PlaceEvaluationArguments& arguments, const Vocabulary& vocabulary) {
  const fs::path folder = arguments.set;
  if (fs::is_directory(folder / "images")) return load_images(folder / "images", arguments.every, vocabulary);
  return load_source(arguments.set, arguments.every, vocabulary);
}

TruePairs::TruePairs(const PlaceEvaluationArguments& arguments, const PlaceSet& set)
    : arguments_(arguments), set_(set) {
  if (arguments.pairs.empty()) {
    for (const DescribedImage& place : set.places) {
      if (!place.T_w_c) throw IoError(arguments.set, "has no true poses: give the true pairs with --pairs");
    }
    return;
  }
  std::string text = arguments.pairs;
  if (fs::is_regular_file(text)) {
    std::ifstream in(text);
    text.assign(std::istreambuf_iterator<char>(in), {});
  }
  parse(text);
}

Truth TruePairs::of(int a, int b) const {
  if (arguments_.pairs.empty()) return from_poses(a, b);
  for (int i = a - arguments_.tolerance; i <= a + arguments_.tolerance; ++i) {
    for (int j = b - arguments_.tolerance; j <= b + arguments_.tolerance; ++j) {
      if (pairs_.contains({i, j}) || pairs_.contains({j, i})) return Truth::kSame;
    }
  }
  return Truth::kOther;
}

void TruePairs::parse(const std::string& text) {
  std::string plain;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) plain += line.substr(0, line.find('#')) + "\n";
  for (char& c : plain) {
    if (c == ',' || c == '-') c = c == ',' ? '\n' : ' ';
  }
  std::istringstream in(plain);
  for (std::string line; std::getline(in, line);) {
    std::istringstream fields(line);
    int i = 0, j = 0;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    if (!(fields >> i >> j) || i < 1 || j < 1) throw IoError("--pairs", fmt::format("'{}' is no pair", line));
    pairs_.insert({i - 1, j - 1});
  }
  if (pairs_.empty()) throw IoError("--pairs", "no pairs");
}

TruePairs::Separation TruePairs::between(int a, int b) const {
  const SE3 T_a_b = set_.places[static_cast<std::size_t>(a)].T_w_c->inverse() *
                    *set_.places[static_cast<std::size_t>(b)].T_w_c;
  const double angle = std::acos(std::clamp(T_a_b.rotation()(2, 2), -1.0, 1.0)) * 180 / std::numbers::pi;
  return {T_a_b.translation().norm() / arguments_.max_distance, angle / arguments_.max_angle_deg};
}

double TruePairs::separation(int a, int b) const {
  const Separation apart = between(a, b);
  return apart.distance + apart.angle;
}

/// Between the bounds and 2.5 times the bounds both answers are right: part of the view is shared.
Truth TruePairs::from_poses(int a, int b) const {
  const Separation apart = between(a, b);
  if (apart.distance <= 1 && apart.angle <= 1) return Truth::kSame;
  return apart.distance > 2.5 || apart.angle > 2.5 ? Truth::kOther : Truth::kUndecided;
}

}  // namespace twofold
