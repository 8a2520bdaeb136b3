#include "tracking/monocular/corner_following.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "base/option_check.hpp"
#include "imaging/guided_search.hpp"
#include "imaging/level_pixels.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr int kTogether = 8;        // positions of a row, whose costs take as long as those of ...
constexpr int kFewestTogether = 4;  // ... so many one by one

struct LevelPatch {
  Patch patch;
  Eigen::Vector2f whole;  ///< pixel of the level around which it was cut
};

/// False when it is too near to the border.
bool cut_at(const ImagePyramid& images, int level, const Eigen::Vector2f& uv, LevelPatch& cut) {
  const Eigen::Vector2f p = to_level(uv.cast<double>(), level);
  cut.whole = {std::round(p.x()), std::round(p.y())};
  return cut_patch(images.level(level), static_cast<int>(cut.whole.x()), static_cast<int>(cut.whole.y()),
                   cut.patch);
}

/// Most similar whole pixel of a square around `centre`, which itself is taken before others that are as
/// similar, as where texture repeats; nothing when the square is outside the image.
std::optional<Eigen::Vector2f> search_square(const Patch& patch, const cv::Mat& image,
                                             const Eigen::Vector2f& centre, int radius) {
  const int u0 = static_cast<int>(std::lround(centre.x()));
  const int v0 = static_cast<int>(std::lround(centre.y()));
  constexpr int kMargin = Patch::kCentre;
  int best = std::numeric_limits<int>::max();
  std::optional<Eigen::Vector2f> result;
  const auto take = [&](int u, int v, int cost) {
    if (cost >= best) return;
    best = cost;
    result = Eigen::Vector2f(static_cast<float>(u), static_cast<float>(v));
  };
  const int u_end = image.cols - kMargin, v_end = image.rows - kMargin;
  if (u0 >= kMargin && u0 <= u_end && v0 >= kMargin && v0 <= v_end)
    take(u0, v0, zero_mean_ssd(patch, image, u0, v0));
  const int last = std::min(u0 + radius, u_end);
  std::array<int, kTogether> ssd;
  for (int v = std::max(v0 - radius, kMargin); v <= std::min(v0 + radius, v_end); ++v) {
    for (int u = std::max(u0 - radius, kMargin); u <= last; u += kTogether) {
      const int wanted = std::min(last - u + 1, kTogether);
      const bool together = wanted >= kFewestTogether && u + kTogether <= u_end;  // a pixel more is read
      const int looked_at = together ? kTogether : wanted;
      zero_mean_ssd_row(patch, image, u, v, std::span(ssd).first(static_cast<std::size_t>(looked_at)));
      for (int i = 0; i < wanted; ++i) take(u + i, v, ssd[static_cast<std::size_t>(i)]);
    }
  }
  return result;
}

}  // namespace

std::string CornerFollowingOptions::invalid_reason() const {
  return OptionCheck()
      .within("coarsest_level", coarsest_level, 0, ImagePyramid::kLevels - 1)
      .at_least("first_radius_px", first_radius_px, 1)
      .at_least("coarse_radius_px", coarse_radius_px, 1)
      .at_least("radius_px", radius_px, 1)
      .at_least("max_radius_px", max_radius_px, radius_px)
      .at_least("max_iterations", max_iterations, 1)
      .reason();
}

bool follow_corner(const ImagePyramid& previous, const ImagePyramid& current,
                   const CornerFollowingOptions& options, FollowedCorner& corner) {
  const int finest = corner.appearance.level;
  Eigen::Vector2f motion = corner.motion.value_or(Eigen::Vector2f::Zero());
  const int whole_radius = corner.motion ? options.coarse_radius_px : options.first_radius_px;
  bool searched = false;
  LevelPatch cut;
  for (int level = options.coarsest_level; level >= finest; --level) {
    if (!cut_at(previous, level, corner.uv, cut)) continue;
    const float s = std::ldexp(1.0F, -level);
    // Near the border the coarse levels have no patch: what is searched widely is the first that has one.
    const int radius =
        searched ? options.radius_px
                 : std::min(whole_radius << (options.coarsest_level - level), options.max_radius_px);
    const auto found = search_square(cut.patch, current.level(level), cut.whole + s * motion, radius);
    if (!found) continue;
    searched = true;
    motion = (*found - cut.whole) / s;
  }
  // The corner's own patch, so that errors do not add up; once it looks otherwise, that of the last frame.
  Patch own;
  warp_patch(corner.appearance, Eigen::Matrix2d::Identity(), finest, own);
  const cv::Mat& image = current.level(finest);
  const Eigen::Vector2f start = to_level((corner.uv + motion).cast<double>(), finest);
  auto found = align_patch(own, image, start, options.max_iterations);
  if (found && looks_alike(own, found->rms, {})) {
    motion = from_level(found->uv, finest).cast<float>() - corner.uv;
  } else {
    if (!cut_at(previous, finest, corner.uv, cut)) return false;
    const float s = std::ldexp(1.0F, -finest);
    found = align_patch(cut.patch, image, cut.whole + s * motion, options.max_iterations);
    if (!found || !looks_alike(cut.patch, found->rms, {})) return false;
    motion = (found->uv - cut.whole) / s;
  }
  corner.uv += motion;
  corner.motion = motion;
  return true;
}

}  // namespace twofold
