#include "selfcalibration/clip_collector.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/median.hpp"
#include "imaging/fast_corners.hpp"
#include "imaging/level_pixels.hpp"
#include "imaging/patch.hpp"
#include "selfcalibration/affine_alignment.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMostViews = 12;    // of a clip
constexpr std::size_t kFewest = 50;       // corners of a clip
constexpr std::size_t kMostActive = 4;    // clips under way
constexpr std::size_t kMostFrames = 120;  // of a clip
constexpr double kFewestShare = 0.3;      // of the corners that a clip began with: it ends with fewer
constexpr double kNextFlow = 0.08;        // of the image's width: then another clip begins
constexpr double kLeastFlow = 0.03;       // of the image's width: less says nothing
constexpr double kSeenShare = 0.75;       // of the views
constexpr double kFirstSpacing = 0.01;    // of the image's width: flow between views
constexpr int kLevels = 2;
constexpr int kThreshold = 10;  // FAST [grey]
constexpr float kMinScore = 10;
constexpr int kBorder = 12;

double median_distance(const std::vector<Eigen::Vector2f>& a, const std::vector<Eigen::Vector2f>& b) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < a.size(); ++i) distances.push_back((a[i] - b[i]).norm());
  return median(std::span(distances));
}

/// By the two neighbours in time [px/s]; of a clip's first frame by the two that follow.
Vector2 velocity_at(const std::vector<std::vector<Eigen::Vector2f>>& places,
                    const std::vector<std::int64_t>& t_ns, std::size_t frame, std::size_t corner) {
  const auto seconds = [&](std::size_t a, std::size_t b) {
    return static_cast<double>(t_ns[b] - t_ns[a]) * 1e-9;
  };
  const auto mean = [&](std::size_t a, std::size_t b) -> Vector2 {
    return (places[b][corner] - places[a][corner]).cast<double>() / seconds(a, b);
  };
  if (frame > 0) return mean(frame - 1, frame + 1);
  return mean(0, 1) - (mean(1, 2) - mean(0, 1)) * seconds(0, 1) / seconds(0, 2);
}

/// A corner must be seen in most of the views.
void remove_rare_corners(Clip& clip) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < clip.corners(); ++i) {
    const auto seen = std::count_if(clip.views.begin(), clip.views.end(),
                                    [&](const ClipView& view) { return view.sees(i); });
    if (static_cast<double>(seen) < kSeenShare * static_cast<double>(clip.views.size())) continue;
    for (ClipView& view : clip.views) {
      view.uv[kept] = view.uv[i];
      view.velocity[kept] = view.velocity[i];
    }
    ++kept;
  }
  for (ClipView& view : clip.views) {
    view.uv.resize(kept);
    view.velocity.resize(kept);
  }
}

}  // namespace

ClipCollector::ClipCollector(int width, int height) : width_(width), height_(height) {}

void ClipCollector::add_frame(const cv::Mat& image, std::int64_t t_ns) {
  auto pyramid = std::make_shared<ImagePyramid>();
  pyramid->build(image);
  current_ = std::move(pyramid);
  for (ActiveClip& clip : active_) follow(t_ns, clip);
  std::erase_if(active_, [&](const ActiveClip& clip) {
    const bool over =
        clip.corners.size() <
            std::max(kFewest,
                     static_cast<std::size_t>(kFewestShare * static_cast<double>(clip.corners_at_first))) ||
        clip.places.size() >= kMostFrames;
    if (over) end_clip(clip);
    return over;
  });
  if (active_.empty() || (active_.size() < kMostActive && flow(active_.back()) > kNextFlow * width_))
    begin_clip(t_ns);
  last_ = current_;
}

void ClipCollector::finish() {
  for (const ActiveClip& clip : active_) end_clip(clip);
  active_.clear();
}

void ClipCollector::begin_clip(std::int64_t t_ns) {
  const int cell = std::max(width_ / 32 / 4 * 4, 8);
  const int columns = width_ / cell + 1, rows = height_ / cell + 1;
  const std::vector<std::uint8_t> occupied(static_cast<std::size_t>(columns * rows), 0);
  std::vector<Corner> found;
  found.reserve(4 * occupied.size());
  for (int level = 0; level < kLevels; ++level)
    detect_corners(current_->level(level), level, kThreshold, kMinScore, kBorder,
                   {cell, columns, rows, occupied}, found);
  std::stable_sort(found.begin(), found.end(),
                   [](const Corner& a, const Corner& b) { return a.score > b.score; });
  ActiveClip clip;
  std::vector<std::uint8_t> taken(occupied.size(), 0);
  for (const Corner& corner : found) {
    FollowedCorner followed;
    if (!cut_appearance(current_->level(corner.level), corner.u, corner.v, corner.level, followed.appearance))
      continue;
    followed.uv = followed.appearance.uv;
    const auto at = static_cast<std::size_t>(static_cast<int>(followed.uv.y()) / cell * columns +
                                             static_cast<int>(followed.uv.x()) / cell);
    if (taken[at] != 0) continue;
    taken[at] = 1;
    clip.corners.push_back(followed);
  }
  if (clip.corners.size() < kFewest) return;
  clip.corners_at_first = clip.corners.size();
  clip.t_ns.push_back(t_ns);
  std::vector<Eigen::Vector2f>& places = clip.places.emplace_back();
  for (const FollowedCorner& corner : clip.corners) places.push_back(corner.uv);
  clip.spacing_px = kFirstSpacing * width_;
  keep_image(clip);
  active_.push_back(std::move(clip));
}

double ClipCollector::flow(const ActiveClip& clip) const {
  return median_distance(clip.places.front(), clip.places.back());
}

void ClipCollector::follow(std::int64_t t_ns, ActiveClip& clip) const {
  std::size_t kept = 0;
  std::vector<Eigen::Vector2f> now;
  for (std::size_t i = 0; i < clip.corners.size(); ++i) {
    if (!follow_corner(*last_, *current_, {}, clip.corners[i])) continue;
    clip.corners[kept] = clip.corners[i];
    for (auto& places : clip.places) places[kept] = places[i];
    now.push_back(clip.corners[i].uv);
    ++kept;
  }
  clip.corners.resize(kept);
  for (auto& places : clip.places) places.resize(kept);
  clip.places.push_back(std::move(now));
  clip.t_ns.push_back(t_ns);
  keep_image(clip);
}

/// Frames evenly along the way that the corners took. When they are too many, every second one goes.
void ClipCollector::keep_image(ActiveClip& clip) const {
  if (!clip.views.empty() &&
      median_distance(clip.places[clip.views.back().frame], clip.places.back()) < clip.spacing_px)
    return;
  if (clip.views.size() == kMostViews) {
    for (std::size_t v = 0; 2 * v < clip.views.size(); ++v) clip.views[v] = clip.views[2 * v];
    clip.views.resize((clip.views.size() + 1) / 2);
    clip.spacing_px *= 2;
  }
  clip.views.push_back({clip.places.size() - 1, current_});
}

void ClipCollector::end_clip(const ActiveClip& clip) {
  if (clip.places.size() < 5 || clip.corners.size() < kFewest / 2 || flow(clip) < kLeastFlow * width_) return;
  Clip result;
  const std::size_t corners = clip.corners.size();
  std::vector<AffineMatch> matches(corners);
  for (const auto& [frame, images] : clip.views) {
    if (frame + 1 >= clip.places.size()) continue;
    ClipView view;
    view.t_ns = clip.t_ns[frame];
    for (std::size_t i = 0; i < corners; ++i) {
      const PointAppearance& appearance = clip.corners[i].appearance;
      matches[i].centre = to_level(clip.places[frame][i].cast<double>(), appearance.level);
      const bool found = frame == 0 || align_affine(appearance, images->level(appearance.level), matches[i]);
      view.uv.push_back(found ? from_level(matches[i].centre, appearance.level) : ClipView::kUnseen);
      view.velocity.push_back(velocity_at(clip.places, clip.t_ns, frame, i));
    }
    result.views.push_back(std::move(view));
  }
  remove_rare_corners(result);
  if (result.views.size() >= 3 && result.corners() >= kFewest / 2) clips_.push_back(std::move(result));
}

}  // namespace twofold
