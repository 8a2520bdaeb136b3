#include "surface/composition.hpp"

#include <algorithm>
#include <utility>

#include "base/right_of_way.hpp"

namespace twofold {

std::size_t Composition::update(std::span<const PlacedVolume> volumes, std::size_t most) {
  let_go_of_empty_blocks();
  remove_all_but(volumes);
  (void)rejoin(volumes, rest_, most < kAll);
  for (const PlacedVolume& volume : volumes) take_changes(volume);
  mark_left();
  const std::size_t blocks = compose(volumes, most);
  mesh_.update(whole_, pending());
  return blocks;
}

std::size_t Composition::settle(std::span<const PlacedVolume> volumes) {
  (void)rejoin(volumes, 0, false);
  return update(volumes);
}

bool Composition::rejoin(std::span<const PlacedVolume> volumes) {
  if (!rejoin(volumes, kRest, true)) return false;
  for (const PlacedVolume& volume : volumes) take_changes(volume);
  mark_left();
  return true;
}

bool Composition::rejoin(std::span<const PlacedVolume> volumes, double rest, bool mesh_moves) {
  Steps steps;
  std::vector<const PlacedVolume*> moved;
  for (const PlacedVolume& volume : volumes) {
    const auto found = members_.find(volume.id);
    if (found == members_.end()) continue;
    Member& member = found->second;
    extend_bounds(member, *volume.volume);
    Step& step = steps[volume.id];
    step = {volume.volume, member.T_w_v.inverse()};
    if (!has_moved(member, volume.T_w_v, rest)) continue;
    step.motion = (volume.T_w_v * step.T_v_w).matrix().topRows<3>();
    moved.push_back(&volume);
  }
  if (moved.empty()) return false;
  if (mesh_moves) mesh_.move([&](const Vector3& x_w) { return mean_motion(steps, x_w); });
  for (const PlacedVolume* volume : moved) {
    Member& member = members_.at(volume->id);
    leave(volume->id, member, has_moved(member, volume->T_w_v, rest_) ? kSoon : kLater);
    member.T_w_v = volume->T_w_v;
  }
  return true;
}

/// By the corners of what it holds: no sample moves farther. What holds nothing has none.
bool Composition::has_moved(const Member& member, const SE3& T_w_v, double rest) const {
  if (rest == 0) return member.T_w_v.matrix() != T_w_v.matrix();
  if (member.holds_nothing()) return false;
  for (int c = 0; c < 8; ++c) {
    const Vector3 corner((c & 1 ? member.high : member.low).x(), (c & 2 ? member.high : member.low).y(),
                         (c & 4 ? member.high : member.low).z());
    if ((T_w_v * corner - member.T_w_v * corner).norm() > rest * whole_.options().voxel) return true;
  }
  return false;
}

/// Of the volumes that a vertex there may rest on; to stand still, if there is none.
Motion Composition::mean_motion(const Steps& steps, const Vector3& x_w) const {
  const Vector3 at = (x_w / (kBlockEdge * whole_.options().voxel)).array().floor();
  const auto block =
      whole_.blocks().number_of({static_cast<std::int32_t>(at.x()), static_cast<std::int32_t>(at.y()),
                                 static_cast<std::int32_t>(at.z())});
  Motion sum = Motion::Zero();
  int count = 0;
  if (block) {
    for (const std::uint32_t id : reached_[*block].volumes) {
      const auto step = steps.find(id);
      if (step == steps.end() || !has_surface(*step->second.volume, step->second.T_v_w * x_w)) continue;
      sum += step->second.motion;
      ++count;
    }
  }
  return count > 0 ? Motion(sum / count) : Motion(Motion::Identity());
}

/// Whether a vertex at x_v may rest on the volume.
bool Composition::has_surface(const SurfaceVolume& volume, const Vector3& x_v) {
  constexpr double kNear = 2.0 / kBlockEdge;  // to the samples around the two that the vertex lies between
  const Vector3 at = x_v / (kBlockEdge * volume.options().voxel);
  const Eigen::Vector3i first = (at.array() - kNear).floor().cast<int>();
  const Eigen::Vector3i last = (at.array() + kNear).floor().cast<int>();
  bool any_inside = false, any_outside = false;
  for (int z = first.z(); z <= last.z(); ++z)
    for (int y = first.y(); y <= last.y(); ++y)
      for (int x = first.x(); x <= last.x(); ++x) {
        const auto number = volume.blocks().number_of({x, y, z});
        if (!number) continue;
        any_inside |= volume.blocks().head(*number).any_inside;
        any_outside |= volume.blocks().head(*number).any_outside;
      }
  return any_inside && any_outside;
}

/// Blocks are never taken out of a volume one by one: where moved volumes have left more than they are in,
/// all are made anew. Not before those are that wait, if that comes before long.
void Composition::let_go_of_empty_blocks() {
  constexpr std::size_t kFew = 1000;
  const std::size_t many = unfinished() ? whole_.blocks().size() / 4 * 3 : whole_.blocks().size() / 2;
  if (empty_blocks_ < std::max(kFew, many)) return;
  for (std::size_t q = 0; q < queues_.size(); ++q) made_[q] += queues_[q].size();
  whole_.clear();
  reached_.clear();
  marks_.clear();
  left_.clear();
  begun_.clear();
  for (auto& queue : queues_) queue.clear();
  empty_blocks_ = 0;
  for (auto& [id, member] : members_) {
    member.blocks.clear();
    member.joined = false;
    member.mark_as = kSoon;
  }
}

void Composition::remove_all_but(std::span<const PlacedVolume> volumes) {
  for (auto member = members_.begin(); member != members_.end();) {
    const bool stays = std::any_of(volumes.begin(), volumes.end(),
                                   [&](const PlacedVolume& volume) { return volume.id == member->first; });
    if (!stays) leave(member->first, member->second, kLater);
    member = stays ? std::next(member) : members_.erase(member);
  }
}

void Composition::leave(std::uint32_t id, Member& member, Mark mark_as) {
  for (const std::uint32_t block : member.blocks) {
    std::vector<std::uint32_t>& volumes = reached_[block].volumes;
    std::erase(volumes, id);
    empty_blocks_ += volumes.empty();
    left_.push_back({block, id, mark_as});
  }
  member.blocks.clear();
  member.joined = false;
  member.mark_as = mark_as;
}

/// After those that volumes have come to: a surface is where it is now before it goes where it was.
void Composition::mark_left() {
  for (const Left& left : left_) mark(left.block, left.volume, left.mark_as);
  left_.clear();
}

/// Marks the blocks into which those reach that changed; all of them, if the volume has moved or was fused
/// anew.
void Composition::take_changes(const PlacedVolume& placed) {
  const SurfaceVolume& volume = *placed.volume;
  const auto [found, is_new] = members_.try_emplace(placed.id);
  Member& member = found->second;
  std::uint64_t known = member.revision;
  if (is_new) {
    member.T_w_v = placed.T_w_v;
  } else if (volume.cleared() > member.revision) {
    leave(placed.id, member, kLater);
    member = {};
    member.T_w_v = placed.T_w_v;
    member.mark_as = kLater;
    known = volume.revision();
  }
  if (member.holds_nothing()) member.T_w_v = placed.T_w_v;
  if (member.joined && volume.revision() == member.revision) return;
  for (std::size_t b = 0; b < volume.blocks().size(); ++b) {
    const BlockHead& block = volume.blocks().head(b);
    if (member.joined && block.revision <= member.revision) continue;
    join(placed.id, member, block.at, block.revision > known ? kNew : member.mark_as);
    make_way();
  }
  extend_bounds(member, volume);
  member.revision = volume.revision();
  member.joined = true;
}

void Composition::join(std::uint32_t id, Member& member, const BlockPosition& block, Mark mark_as) {
  for (const std::uint32_t reached : whole_.add_overlapped(block, member.T_w_v)) {
    if (reached >= reached_.size()) {
      empty_blocks_ += reached + 1 - reached_.size();
      reached_.resize(reached + 1);
      marks_.resize(reached + 1, kNone);
    }
    std::vector<std::uint32_t>& volumes = reached_[reached].volumes;
    const auto at = std::lower_bound(volumes.begin(), volumes.end(), id);
    if (at == volumes.end() || *at != id) {
      empty_blocks_ -= volumes.empty();
      volumes.insert(at, id);
      member.blocks.push_back(reached);
    }
    mark(reached, id, mark_as);
  }
}

/// By the blocks that changed since it was added.
void Composition::extend_bounds(Member& member, const SurfaceVolume& volume) const {
  if (volume.revision() == member.revision) return;
  const double edge = kBlockEdge * whole_.options().voxel;
  for (std::size_t b = 0; b < volume.blocks().size(); ++b) {
    const BlockHead& block = volume.blocks().head(b);
    if (block.revision <= member.revision) continue;
    const Vector3 corner = edge * Vector3(block.at.x, block.at.y, block.at.z);
    member.low = member.low.cwiseMin(corner);
    member.high = member.high.cwiseMax(corner + Vector3::Constant(edge));
  }
}

void Composition::mark(std::uint32_t block, std::uint32_t changed, Mark as) {
  Reached& reached = reached_[block];
  reached.first_changed = std::min(reached.first_changed, changed);
  if (as == kSoon && !std::exchange(reached.is_elsewhere, true) && marks_[block] == kNew)
    queues_[as].push_back(block);  // counted in both
  if (marks_[block] >= as) return;
  marks_[block] = as;
  queues_[as].push_back(block);
}

/// Empty where nothing is.
std::vector<Pending> Composition::pending() const {
  if (!unfinished()) return {};
  std::vector<Pending> of_blocks(marks_.size());
  for (std::size_t b = 0; b < marks_.size(); ++b) {
    if (marks_[b] != kNone) of_blocks[b] = reached_[b].is_elsewhere ? Pending::kOthers : Pending::kChanges;
  }
  return of_blocks;
}

bool Composition::unfinished() const {
  return !left_.empty() ||
         std::any_of(queues_.begin(), queues_.end(), [](const auto& queue) { return !queue.empty(); });
}

std::size_t Composition::compose(std::span<const PlacedVolume> volumes, std::size_t most) {
  Resamplers resamplers;
  for (const PlacedVolume& volume : volumes)
    resamplers.try_emplace(volume.id, *volume.volume, members_.at(volume.id).T_w_v.inverse());
  std::size_t made = 0;
  const auto make_some = [&](Mark marked_as, std::size_t up_to) {
    std::deque<std::uint32_t>& queue = queues_[marked_as];
    for (; !queue.empty() && made < up_to; queue.pop_front(), ++made_[marked_as]) {
      if (marks_[queue.front()] < marked_as) continue;  // made since
      make(queue.front(), marked_as, resamplers);
      ++made;
      make_way();
    }
  };
  make_some(kLater, most / 16);  // nothing waits for all of something else
  make_some(kNew, queues_[kSoon].empty() ? most : most / 2);
  for (const Mark next : {kSoon, kNew, kLater}) make_some(next, most);
  return made;
}

void Composition::make(std::uint32_t block, Mark marked_as, Resamplers& resamplers) {
  constexpr std::size_t kWorthIt = 2;
  constexpr std::size_t kMostBegun = 10000;  // 40 MB, with colours
  if (begun_.size() > kMostBegun) {
    begun_.clear();
    for (Reached& any : reached_) any.begun_before = 0;
  }
  Reached& reached = reached_[block];
  std::vector<Resampler*> all;
  for (const std::uint32_t id : reached.volumes) all.push_back(&resamplers.at(id));
  const auto before = [&](std::uint32_t id) {
    const auto at = std::lower_bound(reached.volumes.begin(), reached.volumes.end(), id);
    return static_cast<std::size_t>(at - reached.volumes.begin());
  };
  if (reached.first_changed < reached.begun_before) reached.begun_before = 0;
  std::size_t begun = before(reached.begun_before);
  const std::size_t unchanged = before(reached.first_changed);
  if (marked_as == kNew && unchanged - begun >= kWorthIt) {
    begin(block, std::span(all).subspan(begun, unchanged - begun));
    begun = unchanged;
  }
  const VoxelBlock* from = begun > 0 ? begun_.find(whole_.blocks().head(block).at) : nullptr;
  whole_.compose_block(block, from, std::span(all).subspan(begun));
  reached.first_changed = kNoVolume;
  reached.is_elsewhere = false;
  marks_[block] = kNone;
}

/// Takes those that follow what is begun of a block into that, up to the first one that has changed.
void Composition::begin(std::uint32_t block, std::span<Resampler* const> next) {
  Reached& reached = reached_[block];
  const BlockPosition at = whole_.blocks().head(block).at;
  whole_.compose_block(block, reached.begun_before > 0 ? begun_.find(at) : nullptr, next);
  begun_.set_samples(begun_.find_or_add(at), whole_.blocks()[block]);
  reached.begun_before = reached.first_changed;
}

std::size_t Composition::bytes() const {
  std::size_t sum = whole_.bytes() + begun_.bytes() + mesh_.bytes() + reached_.capacity() * sizeof(Reached);
  for (const Reached& block : reached_) sum += block.volumes.capacity() * sizeof(block.volumes[0]);
  for (const auto& [id, member] : members_) sum += sizeof(member) + member.blocks.capacity() * 4;
  return sum;
}

}  // namespace twofold
