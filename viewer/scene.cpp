#include "viewer/scene.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <type_traits>

namespace twofold {
namespace {

constexpr const char* kDropped = "dropped: a newer frame was there, or no room to wait";
constexpr float kMoved = 0.002F;   // what moves less is not told again [m]
constexpr int kHalved = 8;         // or doubled: standard deviations [codes]
constexpr float kTurned = 0.001F;  // likewise [components of a unit quaternion]

bool moved(const float (&a)[3], const float (&b)[3], float limit = kMoved) {
  for (int i = 0; i < 3; ++i) {
    if (!(std::abs(a[i] - b[i]) <= limit)) return true;
  }
  return false;
}

Eigen::Isometry3f T_w_k(const ViewKeyframe& keyframe) {
  Eigen::Isometry3f T = Eigen::Isometry3f::Identity();
  const float* q = keyframe.orientation;
  T.linear() = Eigen::Quaternionf(q[3], q[0], q[1], q[2]).toRotationMatrix();
  T.translation() = Eigen::Map<const Eigen::Vector3f>(keyframe.position);
  return T;
}

std::int16_t packed(float component) {
  return static_cast<std::int16_t>(std::lround(32767 * std::clamp(component, -1.0F, 1.0F)));
}

/// -1 is kViewNotKnown.
std::uint32_t number_of(std::int64_t length) {
  return length < 0 ? kViewNotKnown : static_cast<std::uint32_t>(length);
}

/// Of a pose in the old reference keyframe to one in the new.
void move(const Eigen::Isometry3f& T_new_old, ViewPathFrame& frame) {
  Eigen::Map<Eigen::Vector3f> p(frame.in_reference);
  p = (T_new_old * p).eval();
  const std::int16_t* q = frame.turned;
  const Eigen::Quaternionf q_old(q[3], q[0], q[1], q[2]);
  const Eigen::Quaternionf q_new = Eigen::Quaternionf(T_new_old.rotation()) * q_old.normalized();
  for (int i = 0; i < 4; ++i) frame.turned[i] = packed(q_new.coeffs()[i]);
}

/// The keyframe with the greatest id up to `id`, else the first; one without id when there is none.
const ViewKeyframe& nearest(const std::vector<ViewKeyframe>& keyframes, std::uint32_t id) {
  static const ViewKeyframe kNone{.id = kNoId, .part = kNoId};
  if (keyframes.empty()) return kNone;
  const auto after =
      std::upper_bound(keyframes.begin(), keyframes.end(), id,
                       [](std::uint32_t k, const ViewKeyframe& keyframe) { return k < keyframe.id; });
  return after == keyframes.begin() ? *after : *std::prev(after);
}

bool changes_scale(MapEventKind kind) {
  return kind != MapEventKind::kRelocalisation && kind != MapEventKind::kNewPart;
}

using Moved = std::pair<const ViewKeyframe*, const ViewKeyframe*>;  // before, now

/// Spread of the positions about their mean; of the first or second of each pair.
double spread(std::span<const Moved> pairs, const ViewKeyframe* Moved::*which) {
  const auto position = [&](const Moved& pair) {
    return Eigen::Map<const Eigen::Vector3f>((pair.*which)->position).cast<double>().eval();
  };
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Moved& pair : pairs) mean += position(pair) / static_cast<double>(pairs.size());
  double sum = 0;
  for (const Moved& pair : pairs) sum += (position(pair) - mean).squaredNorm();
  return std::sqrt(sum);
}

/// Of the newest keyframes up to this one, or the first ones after it; pairs ascend by id.
std::optional<double> scale_around(std::uint32_t keyframe, std::span<const Moved> pairs) {
  constexpr std::size_t kAround = 10;
  const auto after =
      std::upper_bound(pairs.begin(), pairs.end(), keyframe,
                       [](std::uint32_t id, const Moved& pair) { return id < pair.first->id; });
  const auto end = std::max(static_cast<std::size_t>(after - pairs.begin()), std::min(kAround, pairs.size()));
  const auto around = pairs.subspan(end - std::min(end, kAround), std::min(end, kAround));
  const double before = spread(around, &Moved::first);
  if (around.size() < 2 || !(before > 1e-9)) return std::nullopt;
  return spread(around, &Moved::second) / before;
}

template <class T>
void append(std::string& bytes, const T& value) {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % 4 == 0);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Cuts blocks into messages.
class DeltaWriter {
 public:
  DeltaWriter(Revision from, Revision to)
      : header_{ViewMessageKind::kDelta, from == 0 ? kWhole : 0U, from, to} {
    open();
  }

  template <class Record>
  void block(ViewBlock kind, const std::vector<Record>& records) {
    for (std::size_t begin = 0; begin < records.size();) {
      if (bytes_.size() + 8 + sizeof(Record) > ViewScene::kMessageBytes) close();
      const std::size_t room = (ViewScene::kMessageBytes - bytes_.size() - 8) / sizeof(Record);
      const std::size_t count = std::min(room, records.size() - begin);
      append(bytes_, kind);
      append(bytes_, static_cast<std::uint32_t>(count));
      bytes_.append(reinterpret_cast<const char*>(&records[begin]), count * sizeof(Record));
      begin += count;
    }
  }
  [[nodiscard]] ViewScene::Delta finish() {
    header_.number |= kLast;
    std::memcpy(bytes_.data(), &header_, sizeof header_);
    messages_.push_back(std::make_shared<const std::string>(std::move(bytes_)));
    return std::move(messages_);
  }

 private:
  void open() {
    bytes_.clear();
    append(bytes_, header_);
  }
  void close() {
    messages_.push_back(std::make_shared<const std::string>(std::move(bytes_)));
    header_.number &= ~static_cast<std::uint32_t>(kWhole);  // only the first makes the page forget
    open();
  }

  ViewMessageHeader header_;
  std::string bytes_;
  ViewScene::Delta messages_;
};

}  // namespace

void set_pose_in_reference(const Pose& T_reference_camera, ViewPathFrame& frame) {
  std::copy_n(T_reference_camera.t.begin(), 3, frame.in_reference);
  for (int i = 0; i < 4; ++i) frame.turned[i] = packed(static_cast<float>(T_reference_camera.q[i]));
}

bool differs(const ViewPoint& shown, const ViewPoint& now) {
  return moved(shown.position, now.position) || shown.part != now.part || shown.anchor != now.anchor ||
         shown.observers / 4 != now.observers / 4 || std::abs(shown.deviation - now.deviation) >= kHalved;
}

bool differs(const ViewKeyframe& shown, const ViewKeyframe& now) {
  for (int i = 0; i < 4; ++i) {
    if (std::abs(shown.orientation[i] - now.orientation[i]) > kTurned) return true;
  }
  return moved(shown.position, now.position) || shown.part != now.part || shown.window != now.window ||
         shown.points != now.points || shown.has_place != now.has_place;
}

bool differs(const ViewEdge& shown, const ViewEdge& now) {
  return shown.marginalised != now.marginalised || shown.loop != now.loop ||
         shown.shared_points / 8 != now.shared_points / 8;
}

std::uint8_t ViewScene::reason_number(const char* reason) {
  const auto at = std::find(reasons_.begin(), reasons_.end(), reason);
  if (at != reasons_.end()) return static_cast<std::uint8_t>(at - reasons_.begin());
  if (reasons_.size() == 255) return 0;
  reasons_.emplace_back(reason);
  return static_cast<std::uint8_t>(reasons_.size() - 1);
}

void ViewScene::add(const PoseEstimate& pose, std::span<const std::int64_t> stage_ns,
                    const QueueLengths& waiting, const ViewLosses& losses) {
  begin(pose.t_ns);
  ViewLiveFrame live;
  live.frame = static_cast<std::uint32_t>(pose.frame);
  live.t = seconds(pose.t_ns);
  live.reference = pose.reference_keyframe;
  live.part = pose.map_part;
  live.state = static_cast<std::uint8_t>(pose.state);
  live.reason = reason_number(pose.reason);
  live.keyframe = pose.keyframe ? 1 : 0;
  live.effort = pose.effort;
  std::copy_n(pose.T_world_camera.t.begin(), 3, live.position);
  std::copy_n(pose.T_world_camera.q.begin(), 4, live.orientation);
  live.tracked_share = static_cast<float>(pose.tracked_share);
  live.points = static_cast<std::uint32_t>(pose.points);
  live.latency_ms = static_cast<float>(1e-6 * static_cast<double>(pose.latency_ns));
  live.map_version = static_cast<std::uint32_t>(pose.map_version);
  for (std::size_t s = 0; s < stage_ns.size() && s < kViewStages; ++s)
    live.stage_ms[s] = static_cast<float>(1e-6 * static_cast<double>(stage_ns[s]));
  live.frames_waiting = number_of(waiting.frames);
  live.keyframes_waiting = number_of(waiting.keyframes);
  live.places_waiting = number_of(waiting.places);
  live.frames_dropped = number_of(losses.dropped);
  live.frames_lost = number_of(losses.lost);
  add_dropped(live);
  live_.push_back(live);
  if (live_.size() > kLiveFrames) live_.pop_front();
  ++end_live_;

  ViewPathFrame frame;
  frame.frame = live.frame;
  frame.t = live.t;
  frame.reference = live.reference;
  frame.part = live.part;
  frame.state = live.state;
  frame.reason = live.reason;
  frame.keyframe = live.keyframe;
  frame.effort = live.effort;
  frame.latency_ms = live.latency_ms;
  frame.tracking_ms = std::accumulate(std::begin(live.stage_ms), std::end(live.stage_ms), 0.0F);
  std::copy_n(live.position, 3, frame.causal);
  set_pose_in_reference(pose.T_reference_camera, frame);
  add(frame);
}

void ViewScene::add_dropped(const ViewLiveFrame& next) {
  if (next.frames_dropped == kViewNotKnown || next.frames_dropped <= dropped_) return;
  const std::uint32_t room = next.frame > end_frame_ ? next.frame - end_frame_ : 0;
  const std::uint32_t count = std::min({next.frames_dropped - dropped_, room, kMostDropped});
  dropped_ = next.frames_dropped;
  const float begin_t = end_t_;
  for (std::uint32_t n = 1; n <= count; ++n) {
    ViewPathFrame frame;
    frame.frame = next.frame - count + n - 1;
    frame.t = begin_t + (next.t - begin_t) * static_cast<float>(n) / static_cast<float>(count + 1);
    frame.reference = frame.part = kNoId;
    frame.state = kViewDropped;
    frame.reason = reason_number(kDropped);
    add(frame);
  }
}

void ViewScene::add(const ViewPathFrame& frame) {
  end_frame_ = frame.frame + 1;
  end_t_ = frame.t;
  path_.append(frame, ++revision_);
  if (path_.size() > kMaxPath) thin_path();
}

void ViewScene::thin_path() {
  if (thinned_ > kMaxPath / 2) {
    path_.drop(revision_, [this](std::size_t i) { return i < thinned_ && i % 2 == 1; });
    thinned_ = (thinned_ + 1) / 2;
    path_stride_ *= 2;
  }
  const std::size_t end = path_.size() - kMaxPath / 4;
  path_.drop(revision_,
             [&](std::size_t i) { return i >= thinned_ && i < end && (i - thinned_) % path_stride_ != 0; });
  thinned_ += (end - thinned_ + path_stride_ - 1) / path_stride_;
}

void ViewScene::add(const MapEvent& event) {
  begin(event.t_ns);
  ViewEvent view;
  view.kind = to_string(event.kind);
  view.frame = static_cast<std::uint32_t>(event.frame);
  view.t = seconds(event.t_ns);
  view.keyframe = event.keyframe;
  view.part_before = event.map_part_before;
  view.part = event.map_part;
  view.moved = event.moved;
  view.turned = event.turned;
  view.before = event.T_world_camera_before.t;
  view.after = event.T_world_camera_after.t;
  if (!find_scales_ && waiting_events_.empty()) return add(std::move(view));
  const bool waits = find_scales_ && changes_scale(event.kind) && event.map_version > map_version_;
  waiting_events_.push_back({std::move(view), waits ? event.map_version : 0});
  release_events(0);
}

void ViewScene::release_events(std::uint64_t version) {
  for (; !waiting_events_.empty() && waiting_events_.front().version <= version; waiting_events_.pop_front())
    add(std::move(waiting_events_.front().event));
}

void ViewScene::find_scales(const std::vector<ViewKeyframe>& next, std::uint64_t version) {
  for (WaitingEvent& waiting : waiting_events_) {
    if (waiting.version == 0 || waiting.version > version) continue;
    std::vector<std::pair<const ViewKeyframe*, const ViewKeyframe*>> pairs;
    for (const ViewKeyframe& now : next) {
      const ViewKeyframe* before = keyframes_.find(now.id);
      if (before != nullptr && now.part == waiting.event.part && before->part == waiting.event.part_before)
        pairs.emplace_back(before, &now);
    }
    waiting.event.scale = scale_around(waiting.event.keyframe, pairs);
  }
  release_events(version);
}

void ViewScene::add(ViewEvent event) {
  events_.push_back(std::move(event));
  if (events_.size() > kMaxEvents) events_.pop_front();
  ++end_event_;
}

void ViewScene::add_loops(const std::vector<MapSnapshot::Loop>& loops) {
  for (; loops_ < loops.size(); ++loops_) {
    const MapSnapshot::Loop& loop = loops[loops_];
    begin(loop.t_ns);
    ViewEvent event;
    event.kind = "loop";
    event.t = seconds(loop.t_ns);
    event.keyframe = loop.to;
    event.moved = loop.drift;
    event.turned = loop.turned;
    event.loop = loop;
    if (const ViewKeyframe* came_back = keyframes_.find(loop.to)) {
      event.frame = came_back->frame;
      event.part = event.part_before = came_back->part;
      for (std::size_t k = 0; k < 3; ++k) event.before[k] = event.after[k] = came_back->position[k];
    }
    add(std::move(event));
  }
}

void ViewScene::show(const ViewMap& map) {
  find_scales(map.keyframes, map.version);
  const Revision next = revision_ + 1;
  rebind_path(map.keyframes, next);
  keyframes_.replace(map.keyframes, next);
  points_.replace(map.points, next);
  edges_.replace(map.edges, next);
  map_version_ = map.version;
  revision_ = next;
}

void ViewScene::show_keyframes(const std::vector<ViewKeyframe>& keyframes, std::uint64_t version) {
  find_scales(keyframes, version);
  const Revision next = revision_ + 1;
  rebind_path(keyframes, next);
  keyframes_.replace(keyframes, next);
  revision_ = next;
}

void ViewScene::rebind_path(const std::vector<ViewKeyframe>& next, Revision revision) {
  path_.change_all(revision, [&](ViewPathFrame& frame) {
    const ViewKeyframe* gone = keyframes_.find(frame.reference);
    if (gone == nullptr || nearest(next, gone->id).id == gone->id) return false;
    const ViewKeyframe& replacement = nearest(next, gone->id);
    frame.reference = replacement.part == gone->part ? replacement.id : kNoId;
    // Both as they were together, if they were.
    const ViewKeyframe* before = keyframes_.find(replacement.id);
    move(T_w_k(before != nullptr ? *before : replacement).inverse() * T_w_k(*gone), frame);
    return true;
  });
}

std::shared_ptr<const ViewScene::Delta> ViewScene::delta(Revision since) const {
  const bool known =
      points_.knows(since) && keyframes_.knows(since) && edges_.knows(since) && path_.knows(since);
  if (!known) since = 0;
  std::erase_if(encoded_, [](const Encoded& encoded) { return encoded.delta.expired(); });
  for (const Encoded& encoded : encoded_) {
    if (encoded.since != since || encoded.to != revision_) continue;
    if (auto delta = encoded.delta.lock()) return delta;
  }
  auto delta = encode(since);
  encoded_.push_back({since, revision_, delta});
  return delta;
}

std::shared_ptr<const ViewScene::Delta> ViewScene::encode(Revision since) const {
  DeltaWriter writer(since, revision_);
  // Points last: they are the most, and the picture begins with the path.
  writer.block(ViewBlock::kKeyframesGone, keyframes_.gone_since(since));
  writer.block(ViewBlock::kKeyframes, keyframes_.changed_since(since));
  writer.block(ViewBlock::kPathGone, path_.gone_since(since));
  writer.block(ViewBlock::kPath, path_.changed_since(since));
  writer.block(ViewBlock::kEdgesGone, edges_.gone_since(since));
  writer.block(ViewBlock::kEdges, edges_.changed_since(since));
  writer.block(ViewBlock::kPointsGone, points_.gone_since(since));
  writer.block(ViewBlock::kPoints, points_.changed_since(since));
  return std::make_shared<const Delta>(writer.finish());
}

}  // namespace twofold
