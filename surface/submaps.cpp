#include "surface/submaps.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "base/processor_time.hpp"

namespace twofold {
namespace {

constexpr std::size_t kKeptImages = 4;  // of the frames that wait: 6 MB at 640 x 480
constexpr double kBend = 0.5;           // voxels that poses inside a group may move

/// T_w_s beside the keyframe, in whole blocks of the world's grid and not turned: until a loop moves the
/// submap, a composition takes its samples as they are.
SE3 begin_of_submap(const SE3& T_k_w, double voxel) {
  const double edge = kBlockEdge * voxel;
  const Vector3 blocks = (T_k_w.inverse().translation() / edge).array().round();
  return SE3(SO3(), edge * blocks);
}

DepthImages unpacked(const KeyframeDepth& packed) {
  return {packed.depth.unpacked(), packed.colour.unpacked()};
}

std::size_t bytes_of(const cv::Mat& image) {
  return image.total() * image.elemSize();
}
std::size_t bytes_of(const KeyframeDepth& packed) {
  return packed.depth.bytes() + packed.colour.bytes();
}

}  // namespace

std::string SubmapOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_keyframes", max_keyframes, 1)
      .at_least("max_waiting", static_cast<double>(max_waiting), 1)
      .above("memory_mb", memory_mb, 0)
      .at_least("max_free_depth", max_free_depth, 0)
      .reason();
}

KeyframeDepth pack_keyframe_depth(std::int64_t frame_index, const cv::Mat& depth, const cv::Mat& colour) {
  KeyframeDepth packed;
  packed.frame_index = frame_index;
  packed.depth = PackedDepth(depth);
  if (!colour.empty()) packed.colour = PackedColour(colour);
  return packed;
}

SubmapSurface::SubmapSurface(const Rig& rig, const SurfaceOptions& options, const SubmapOptions& submaps)
    : rig_(rig), options_(options), limits_(submaps), next_keyframe_(submaps.first_keyframe) {
  TWOFOLD_CHECK(options.invalid_reason().empty() && submaps.invalid_reason().empty(), "valid options");
}

void SubmapSurface::offer(KeyframeDepth frame, DepthImages images) {
  waiting_.push_back({std::move(frame), std::move(images)});
  if (waiting_.size() > kKeptImages) waiting_[waiting_.size() - 1 - kKeptImages].images = {};
  if (waiting_.size() <= limits_.max_waiting) return;
  waiting_.pop_front();
  ++report_.overtaken;
}

void SubmapSurface::step(const GraphSnapshot& graph, const SubmapWork& work) {
  let_go_of_culled(graph);
  move_submaps(graph);
  fuse_bent(work.anew);
  take_new_keyframes(graph, work.keyframes);
  report_.most_bytes = std::max(report_.most_bytes, bytes());
}

/// A submap whose keyframe was culled hangs on another one from here on, where both stood in the last step.
void SubmapSurface::let_go_of_culled(const GraphSnapshot& graph) {
  for (const auto& submap : submaps_) {
    report_.culled += static_cast<int>(std::erase_if(
        submap->members, [&](const Member& member) { return graph.keyframe(member.id).culled(); }));
    if (submap->members.empty() || !graph.keyframe(submap->hung_on).culled()) continue;
    const Member& stays = submap->members.front();
    submap->hung_on = stays.id;
    submap->T_k_s = stays.T_k_w * submap->T_w_s;
  }
  report_.submaps_dropped +=
      static_cast<int>(std::erase_if(submaps_, [](const auto& submap) { return submap->members.empty(); }));
}

void SubmapSurface::move_submaps(const GraphSnapshot& graph) {
  for (const auto& submap : submaps_) {
    const Keyframe& hung_on = graph.keyframe(submap->hung_on);
    submap->T_w_s = hung_on.T_k_w.inverse() * submap->T_k_s;
    submap->part = hung_on.part;
    for (Member& member : submap->members) member.T_k_w = graph.keyframe(member.id).T_k_w;
  }
}

/// The one that is begun first, then those that are bent most.
void SubmapSurface::fuse_bent(std::size_t most) {
  std::vector<std::pair<double, Submap*>> bent;
  for (const auto& submap : submaps_) {
    const double bend = submap->anew ? std::numeric_limits<double>::infinity() : bend_of(*submap);
    if (bend > kBend * options_.voxel) bent.emplace_back(bend, submap.get());
  }
  std::stable_sort(bent.begin(), bent.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  bent_ = bent.size();
  for (auto next = bent.begin(); next != bent.end() && most > 0; ++next) {
    most -= fuse_anew(*next->second, most);
    bent_ -= !next->second->anew;
  }
}

/// Other submaps' images are not asked again about what they hide: the map may have culled their keyframes.
std::size_t SubmapSurface::fuse_anew(Submap& submap, std::size_t most) {
  if (!submap.anew) submap.anew.emplace(options_, limits_);
  std::size_t fused = 0;
  for (Member& member : submap.members) {
    if (member.T_k_s_anew) continue;
    if (fused == most) return fused;
    ++fused;
    member.T_k_s_anew = member.T_k_w * submap.T_w_s;
    report_.fused_anew += fuse(*submap.anew, member, *member.T_k_s_anew, {});
  }
  submap.anew->replace(submap.content);
  submap.content = std::move(*submap.anew);
  submap.anew.reset();
  for (Member& member : submap.members) member.T_k_s = *std::exchange(member.T_k_s_anew, std::nullopt);
  return fused;
}

/// By how much a point that one of the keyframes sees would be fused elsewhere now, at most [m].
double SubmapSurface::bend_of(const Submap& submap) const {
  double most = 0;
  for (const Member& member : submap.members) {
    const SE3 T_now_then = member.T_k_w * submap.T_w_s * member.T_k_s.inverse();
    most = std::max(most, T_now_then.translation().norm() + T_now_then.so3().log().norm() * member.reach);
  }
  return most;
}

/// Both depth and keyframes come in the order of frames, either of them first.
void SubmapSurface::take_new_keyframes(const GraphSnapshot& graph, std::size_t most) {
  for (; next_keyframe_ < graph.keyframe_count(); ++next_keyframe_) {
    without_depth_.push_back(KeyframeId{next_keyframe_});
    if (without_depth_.size() > limits_.max_waiting) without_depth_.pop_front();
  }
  keyframes_left_ = false;
  while (!without_depth_.empty() && !waiting_.empty()) {
    const Keyframe& keyframe = graph.keyframe(without_depth_.front());
    const std::int64_t frame = waiting_.front().packed.frame_index;
    if (keyframe.culled() || keyframe.frame_index < frame) {
      without_depth_.pop_front();
      continue;
    }
    if (frame < keyframe.frame_index) {
      waiting_.pop_front();
      ++report_.not_in_map;
      continue;
    }
    keyframes_left_ = most == 0;
    if (keyframes_left_) return;
    --most;
    Waiting frame_of_keyframe = std::move(waiting_.front());
    waiting_.pop_front();
    without_depth_.pop_front();
    add_keyframe(graph, keyframe, std::move(frame_of_keyframe));
  }
}

void SubmapSurface::add_keyframe(const GraphSnapshot& graph, const Keyframe& keyframe, Waiting frame) {
  if (static_cast<double>(bytes() - bytes_anew()) > limits_.memory_mb * (1 << 20)) {
    ++report_.beyond_memory;
    return;
  }
  Submap& submap = submap_for(graph, keyframe);
  Member member;
  member.id = keyframe.id;
  member.packed = std::move(frame.packed);
  member.reach = std::max(keyframe.median_depth, rig_.depth_min);
  member.T_k_w = keyframe.T_k_w;
  member.T_k_s = member.T_k_w * submap.T_w_s;
  const bool any = fuse(submap.content, member, member.T_k_s, std::move(frame.images));
  if (any && limits_.free_space) forget_hidden(submap, member.T_k_w);
  report_.without_readings += !any;
  submap.members.push_back(std::move(member));
}

/// The submap of those keyframes that see most of the same points, if it has room.
SubmapSurface::Submap& SubmapSurface::submap_for(const GraphSnapshot& graph, const Keyframe& keyframe) {
  Submap* best = nullptr;
  int most = 0;
  for (const auto& submap : submaps_) {
    if (static_cast<int>(submap->members.size()) >= limits_.max_keyframes || submap->part != keyframe.part)
      continue;
    int shared = 0;
    for (const Member& member : submap->members) {
      const Edge* edge = find_edge(keyframe, member.id);
      if (edge != nullptr) shared += edge->weight;
    }
    if (shared > most) {
      most = shared;
      best = submap.get();
    }
  }
  if (best != nullptr) return *best;
  const SE3 T_k_w = graph.T_k_w(keyframe.id);
  const SE3 T_w_s = begin_of_submap(T_k_w, options_.voxel);
  submaps_.push_back(std::make_unique<Submap>(Submap{.id = next_submap_++,
                                                     .hung_on = keyframe.id,
                                                     .T_k_s = T_k_w * T_w_s,
                                                     .T_w_s = T_w_s,
                                                     .part = keyframe.part,
                                                     .members = {},
                                                     .content = Submap::Content(options_, limits_),
                                                     .anew = {}}));
  return *submaps_.back();
}

bool SubmapSurface::fuse(Submap::Content& into, const Member& member, const SE3& T_k_s, DepthImages images) {
  const std::int64_t begin_ns = thread_cpu_ns();
  if (images.depth.empty()) images = unpacked(member.packed);
  prepare_depth_view(rig_, images.depth, images.colour, view_);
  const bool any = share_of_readings(view_) > 0;
  if (any) into.volume_to_change().fuse(view_, T_k_s);
  if (any && limits_.free_space) into.free_to_change().add(view_, T_k_s);
  report_.fused += any;
  report_.fusion_ns += thread_cpu_ns() - begin_ns;
  return any;
}

void SubmapSurface::forget_hidden(const Submap& fused_into, const SE3& T_k_w) {
  for (const auto& submap : submaps_)
    if (submap.get() != &fused_into && submap->part == fused_into.part)
      submap->content.free_to_change().forget_hidden(view_, T_k_w * submap->T_w_s);
}

SubmapSurface::Submap::Content::Content(const SurfaceOptions& options, const SubmapOptions& submaps)
    : volume(std::make_shared<SurfaceVolume>(options)),
      free(submaps.free_space ? std::make_shared<FreeSpace>(options, submaps.max_free_depth) : nullptr) {}

void SubmapSurface::Submap::Content::replace(const Content& before) {
  volume->replace(*before.volume);
  if (free != nullptr) free->forget_as(*before.free);
}

std::size_t SubmapSurface::Submap::Content::bytes() const {
  return volume->bytes() + (free != nullptr ? free->bytes() : 0);
}

SurfaceVolume& SubmapSurface::Submap::Content::volume_to_change() {
  if (std::exchange(volume_shared, false)) volume = std::make_shared<SurfaceVolume>(*volume);
  return *volume;
}

FreeSpace& SubmapSurface::Submap::Content::free_to_change() {
  if (std::exchange(free_shared, false)) free = std::make_shared<FreeSpace>(*free);
  return *free;
}

SurfaceVolume SubmapSurface::whole(KeyframeId part) const {
  SurfaceVolume all(options_);
  for (const auto& submap : submaps_)
    if (submap->part == part) all.add(*submap->content.volume, submap->T_w_s);
  return all;
}

std::vector<PlacedVolume> SubmapSurface::placed(KeyframeId part) const {
  std::vector<PlacedVolume> volumes;
  for (const auto& submap : submaps_)
    if (submap->part == part) volumes.push_back({submap->id, submap->content.volume.get(), submap->T_w_s});
  return volumes;
}

std::vector<SharedSubmap> SubmapSurface::share() {
  std::vector<SharedSubmap> shared;
  for (const auto& submap : submaps_) {
    Submap::Content& content = submap->content;
    content.volume_shared = content.free_shared = true;
    shared.push_back({submap->part, content.volume, content.free, submap->T_w_s});
  }
  return shared;
}

std::size_t SubmapSurface::bytes_anew() const {
  std::size_t sum = 0;
  for (const auto& submap : submaps_)
    if (submap->anew) sum += submap->anew->bytes();
  return sum;
}

std::size_t SubmapSurface::bytes() const {
  std::size_t sum = bytes_anew();
  for (const Waiting& frame : waiting_)
    sum += bytes_of(frame.packed) + bytes_of(frame.images.depth) + bytes_of(frame.images.colour);
  for (const auto& submap : submaps_) {
    sum += submap->content.bytes();
    for (const Member& member : submap->members) sum += bytes_of(member.packed);
  }
  return sum;
}

}  // namespace twofold
