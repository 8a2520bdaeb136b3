#include "doctor/depth_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <string>
#include <vector>

#include "base/median.hpp"

namespace twofold {
namespace {

constexpr double kFewPixels = 0.1;   // share of all: no map starts with fewer
constexpr double kFewInRange = 0.8;  // share of those with depth: in halls some of it is beyond any reach

/// All that is not a hole, in units of the images.
std::vector<std::uint16_t> readings(std::span<const cv::Mat> images) {
  std::vector<std::uint16_t> all;
  for (const cv::Mat& image : images)
    for (int row = 0; row < image.rows; ++row)
      std::copy_if(image.ptr<std::uint16_t>(row), image.ptr<std::uint16_t>(row) + image.cols,
                   std::back_inserter(all), [](std::uint16_t depth) { return depth > 0; });
  return all;
}

double share(std::size_t some, std::size_t all) {
  return static_cast<double>(some) / static_cast<double>(std::max<std::size_t>(1, all));
}

}  // namespace

Finding check_depth(std::span<const cv::Mat> images, const Rig& rig) {
  const std::string subject = "depth";
  std::size_t pixels = 0;
  for (const cv::Mat& image : images) pixels += image.total();
  std::vector<std::uint16_t> all = readings(images);
  if (all.empty()) return {Health::kBad, subject, "no pixel has any", "look at the depth images"};
  const double measured = share(all.size(), pixels);
  const auto in_range = std::count_if(all.begin(), all.end(), [&](std::uint16_t depth) {
    const double metres = depth * rig.depth_unit;
    return metres >= rig.depth_min && metres <= rig.depth_max;
  });
  const double usable = share(static_cast<std::size_t>(in_range), all.size());
  const double middle = median(std::span(all)) * rig.depth_unit;
  const std::string state = fmt::format(
      "in {:.0f} % of the pixels, half of it nearer than {:.2f} m, {:.0f} % of it from {:g} to {:g} m",
      100 * measured, middle, 100 * usable, rig.depth_min, rig.depth_max);
  if (usable < kFewInRange)
    return {
        Health::kWarn, subject, state,
        "depth_scale is wrong (5000 units a metre in TUM's recordings, 1000 in most others), or depth_min, "
        "depth_max"};
  if (measured < kFewPixels) return {Health::kWarn, subject, state, "look at the depth images"};
  return {Health::kOk, subject, state, ""};
}

}  // namespace twofold
