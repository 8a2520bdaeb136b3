#include "tracking/monocular_start.hpp"

#include <algorithm>
#include <cmath>

#include "imaging/image_buffers.hpp"

namespace twofold {
namespace {

constexpr std::size_t kCandidates = 4;
constexpr std::size_t kMostBetween = 4;      // frames between a candidate and now that tell motions apart
constexpr double kNextCandidateFlow = 0.03;  // of the image's width: a new candidate is worth its place
constexpr double kFewestLeft = 0.4;          // share of its corners below which a candidate is given up

double median_flow(const StartCandidate& candidate) {
  std::vector<float> flow;
  for (const FollowedCorner& corner : candidate.corners)
    flow.push_back((corner.uv - corner.appearance.uv).norm());
  if (flow.empty()) return 0;
  const auto middle = flow.begin() + static_cast<std::ptrdiff_t>(flow.size() / 2);
  std::nth_element(flow.begin(), middle, flow.end());
  return *middle;
}

/// Cells so small that an image of any size has enough of them: while nothing is known, corners stand close.
TrackerOptions with_cells_for(const Rig& rig, TrackerOptions options) {
  constexpr double kCellsPerCorner = 2;
  constexpr int kUnit = 4;  // CellGrid
  const double area = static_cast<double>(rig.camera.width) * rig.camera.height;
  const double side = std::sqrt(area / (kCellsPerCorner * options.max_new_points));
  options.cell_px = std::clamp(static_cast<int>(side) / kUnit * kUnit, 2 * kUnit, options.cell_px);
  return options;
}

}  // namespace

MonocularStart::MonocularStart(const Rig& rig, const TrackerOptions& options)
    : rig_(rig), options_(options), starter_(rig, with_cells_for(rig, options)), candidates_(kCandidates) {
  const auto corners = static_cast<std::size_t>(options.max_new_points);
  for (StartCandidate& candidate : candidates_) {
    allocate_images(rig, candidate.images);
    candidate.corners.reserve(corners);
  }
  allocate_images(rig, last_);
  order_.reserve(kCandidates);
  appearances_.reserve(corners);
}

void MonocularStart::reset() {
  order_.clear();
  has_last_ = false;
}

tl::expected<MonocularStartResult, LostCause> MonocularStart::step(const FrameImages& images,
                                                                   const Frame& frame) {
  if (has_last_) {
    for (const std::size_t c : order_) follow(images, candidates_[c]);
  }
  LostCause cause = LostCause::kTooLittleParallax;
  // The oldest one has seen most motion, and says what is missing.
  for (const std::size_t c : order_) {
    const auto structure = examine(candidates_[c]);
    if (structure) return MonocularStartResult{&candidates_[c], *structure};
    if (c == order_.front()) cause = structure.error();
  }
  renew_candidates(images, frame);
  last_.left.copy_from(images.left);
  has_last_ = true;
  return tl::unexpected(candidates_[order_.front()].corners.empty() ? LostCause::kTooFewCorners : cause);
}

void MonocularStart::follow(const FrameImages& images, StartCandidate& candidate) const {
  remember_place(candidate);
  ++candidate.age;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < candidate.corners.size(); ++i) {
    if (!follow_corner(last_.left, images.left, candidate.corners[i])) continue;
    candidate.corners[kept] = candidate.corners[i];
    for (auto& places : candidate.between) places[kept] = places[i];
    ++kept;
  }
  candidate.corners.resize(kept);
  for (auto& places : candidate.between) places.resize(kept);
}

/// Every stride-th frame is one between. When they are too many, every second one goes.
void MonocularStart::remember_place(StartCandidate& candidate) {
  if (candidate.age == 0 || candidate.age % candidate.stride != 0) return;
  auto& between = candidate.between;
  if (between.size() == kMostBetween) {
    for (std::size_t b = 0; 2 * b + 1 < between.size(); ++b) std::swap(between[b], between[2 * b + 1]);
    between.resize(kMostBetween / 2);
    candidate.stride *= 2;
    if (candidate.age % candidate.stride != 0) return;
  }
  auto& places = between.emplace_back();
  for (const FollowedCorner& corner : candidate.corners) places.push_back(corner.uv);
}

tl::expected<FirstStructure, LostCause> MonocularStart::examine(const StartCandidate& candidate) const {
  if (candidate.between.empty()) return tl::unexpected(LostCause::kTooLittleParallax);
  const auto as_pixels = [](const std::vector<Eigen::Vector2f>& places) {
    std::vector<Vector2> pixels;
    for (const Eigen::Vector2f& uv : places) pixels.push_back(uv.cast<double>());
    return pixels;
  };
  CornerViews views;
  for (const FollowedCorner& corner : candidate.corners) {
    views.first.push_back(corner.appearance.uv.cast<double>());
    views.last.push_back(corner.uv.cast<double>());
  }
  for (const auto& places : candidate.between) views.between.push_back(as_pixels(places));
  return first_structure(rig_, views, options_.first_structure);
}

/// Gives up candidates of which little is still in view, and takes the frame as one when the newest has been
/// left behind. The oldest makes room for it.
void MonocularStart::renew_candidates(const FrameImages& images, const Frame& frame) {
  std::erase_if(order_, [&](std::size_t c) {
    const StartCandidate& candidate = candidates_[c];
    const auto fewest =
        static_cast<std::size_t>(kFewestLeft * static_cast<double>(candidate.corners_at_first));
    return candidate.corners.size() < std::max<std::size_t>(fewest, 1);
  });
  if (!order_.empty() && median_flow(candidates_[order_.back()]) < kNextCandidateFlow * rig_.camera.width)
    return;
  if (order_.size() == kCandidates) order_.erase(order_.begin());
  std::size_t free = 0;
  while (std::find(order_.begin(), order_.end(), free) != order_.end()) ++free;
  fill(candidates_[free], images, frame);
  order_.push_back(free);
}

void MonocularStart::fill(StartCandidate& candidate, const FrameImages& images, const Frame& frame) {
  candidate.frame_index = frame.index;
  candidate.t_ns = frame.t_ns;
  candidate.age = 0;
  candidate.images.left.copy_from(images.left);
  starter_.clear();
  appearances_.clear();
  starter_.choose_corners(images, appearances_);
  candidate.corners.clear();
  candidate.between.clear();
  candidate.stride = 1;
  for (const PointAppearance& appearance : appearances_) {
    candidate.corners.push_back({appearance, appearance.uv, std::nullopt});
  }
  candidate.corners_at_first = candidate.corners.size();
}

}  // namespace twofold
