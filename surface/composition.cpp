#include "surface/composition.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/right_of_way.hpp"

namespace twofold {
namespace {

constexpr std::size_t kAsked = 64;  // blocks from one question to the next: about a millisecond

}  // namespace

std::size_t Composition::update(std::span<const PlacedVolume> volumes, double rest, const GivesUp& gives_up) {
  let_go_of_empty_blocks();
  remove_all_but(volumes, rest);
  for (const PlacedVolume& volume : volumes) take_changes(volume);
  const std::size_t blocks = compose(volumes, gives_up);
  if (unfinished()) return blocks;
  mesh_.update(whole_);
  mesh_at_.clear();
  for (const auto& [id, member] : members_) mesh_at_.emplace(id, member.T_w_v);
  return blocks;
}

bool Composition::rejoin_farthest(std::span<const PlacedVolume> volumes) {
  auto farthest = members_.end();
  double most = kRest * whole_.options().voxel;
  for (const PlacedVolume& volume : volumes) {
    const auto member = members_.find(volume.id);
    if (member == members_.end()) continue;
    const double way = farthest_way(member->second, member->second.T_w_v, volume.T_w_v);
    if (way <= most) continue;
    most = way;
    farthest = member;
  }
  if (farthest == members_.end()) return false;
  remove(farthest->first, farthest->second);
  members_.erase(farthest);
  return true;
}

bool Composition::move_mesh(std::span<const PlacedVolume> volumes) {
  std::vector<Moved> all;
  bool any = false;
  for (const PlacedVolume& volume : volumes) {
    const auto member = members_.find(volume.id);
    const auto at = mesh_at_.find(volume.id);
    if (member == members_.end() || at == mesh_at_.end()) continue;
    Moved moved{volume.volume, at->second.inverse(), Motion::Identity()};
    if (farthest_way(member->second, at->second, volume.T_w_v) > rest_ * whole_.options().voxel) {
      moved.motion = (volume.T_w_v * at->second.inverse()).matrix().topRows<3>();
      at->second = volume.T_w_v;
      any = true;
    }
    all.push_back(std::move(moved));
  }
  if (any) mesh_.move([&](const Vector3& x_w) { return mean_motion(all, x_w); });
  return any;
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

/// Of the volumes that a vertex there may rest on; to stand still, if there is none.
Motion Composition::mean_motion(std::span<const Moved> all, const Vector3& x_w) {
  Motion sum = Motion::Zero();
  int count = 0;
  for (const Moved& one : all) {
    if (!has_surface(*one.volume, one.T_v_w * x_w)) continue;
    sum += one.motion;
    ++count;
  }
  return count > 0 ? Motion(sum / count) : Motion(Motion::Identity());
}

/// Blocks are never taken out of a volume one by one: where moved volumes have left more than they are in,
/// all begins anew.
void Composition::let_go_of_empty_blocks() {
  constexpr std::size_t kFew = 1000;
  if (empty_blocks_ < std::max(kFew, whole_.blocks().size() / 2)) return;
  whole_.clear();
  members_.clear();
  in_block_.clear();
  is_marked_.clear();
  marked_.clear();
  empty_blocks_ = 0;
}

/// By the blocks that changed since it was added.
void Composition::extend_bounds(Member& member, const SurfaceVolume& volume) const {
  if (volume.revision() == member.revision) return;
  make_way();
  const double edge = kBlockEdge * whole_.options().voxel;
  for (std::size_t b = 0; b < volume.blocks().size(); ++b) {
    const BlockHead& block = volume.blocks().head(b);
    if (block.revision <= member.revision) continue;
    const Vector3 corner = edge * Vector3(block.at.x, block.at.y, block.at.z);
    member.low = member.low.cwiseMin(corner);
    member.high = member.high.cwiseMax(corner + Vector3::Constant(edge));
  }
}

bool Composition::still_stands(Member& member, const PlacedVolume& now, double rest) const {
  if (now.volume->cleared() > member.revision) return false;
  extend_bounds(member, *now.volume);
  if ((member.low.array() > member.high.array()).any()) return false;  // it holds nothing
  if (rest == 0) return member.T_w_v.matrix() == now.T_w_v.matrix();
  return farthest_way(member, member.T_w_v, now.T_w_v) <= rest * whole_.options().voxel;
}

/// That a sample moves [m], by the corners of what it holds: none moves farther.
double Composition::farthest_way(const Member& member, const SE3& T_old, const SE3& T_new) {
  double most = 0;
  for (int c = 0; c < 8; ++c) {
    const Vector3 corner((c & 1 ? member.high : member.low).x(), (c & 2 ? member.high : member.low).y(),
                         (c & 4 ? member.high : member.low).z());
    most = std::max(most, (T_new * corner - T_old * corner).norm());
  }
  return most;
}

void Composition::remove_all_but(std::span<const PlacedVolume> volumes, double rest) {
  for (auto member = members_.begin(); member != members_.end();) {
    const auto now = std::find_if(volumes.begin(), volumes.end(),
                                  [&](const PlacedVolume& volume) { return volume.id == member->first; });
    if (now != volumes.end() && still_stands(member->second, *now, rest)) {
      ++member;
      continue;
    }
    remove(member->first, member->second);
    member = members_.erase(member);
  }
}

void Composition::remove(std::uint32_t id, const Member& member) {
  for (const std::uint32_t block : member.blocks) {
    std::erase(in_block_[block], id);
    empty_blocks_ += in_block_[block].empty();
    mark(block);
  }
}

void Composition::mark(std::uint32_t block) {
  if (is_marked_[block] != 0) return;
  is_marked_[block] = 1;
  marked_.push_back(block);
}

/// Marks the blocks into which those reach that changed.
void Composition::take_changes(const PlacedVolume& placed) {
  const auto [found, is_new] = members_.try_emplace(placed.id);
  Member& member = found->second;
  if (is_new) {
    member.T_w_v = placed.T_w_v;
    extend_bounds(member, *placed.volume);
  }
  if (placed.volume->revision() == member.revision) return;
  const BlockTable& blocks = placed.volume->blocks();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const BlockHead& block = blocks.head(b);
    if (block.revision <= member.revision) continue;
    for (const std::uint32_t reached : whole_.add_overlapped(block.at, member.T_w_v)) {
      if (reached >= in_block_.size()) {
        empty_blocks_ += reached + 1 - in_block_.size();
        in_block_.resize(reached + 1);
        is_marked_.resize(reached + 1, 0);
      }
      std::vector<std::uint32_t>& ids = in_block_[reached];
      const auto at = std::lower_bound(ids.begin(), ids.end(), placed.id);
      if (at == ids.end() || *at != placed.id) {
        empty_blocks_ -= ids.empty();
        ids.insert(at, placed.id);
        member.blocks.push_back(reached);
      }
      mark(reached);
    }
    make_way();
  }
  member.revision = placed.volume->revision();
}

std::size_t Composition::compose(std::span<const PlacedVolume> volumes, const GivesUp& gives_up) {
  std::map<std::uint32_t, Resampler> resamplers;
  for (const PlacedVolume& volume : volumes)
    resamplers.try_emplace(volume.id, *volume.volume, members_.at(volume.id).T_w_v.inverse());
  std::vector<Resampler*> reaching;
  std::size_t done = 0;
  for (const std::size_t all = marked_.size(); done < all; ++done) {
    if (gives_up && done % kAsked == kAsked - 1 &&
        gives_up(static_cast<double>(done) / static_cast<double>(all)))
      break;
    const std::uint32_t block = marked_[done];
    reaching.clear();
    for (const std::uint32_t id : in_block_[block]) reaching.push_back(&resamplers.at(id));
    whole_.compose_block(block, reaching);
    is_marked_[block] = 0;
    make_way();
  }
  marked_.erase(marked_.begin(), marked_.begin() + static_cast<std::ptrdiff_t>(done));
  return done;
}

std::size_t Composition::bytes() const {
  using Ids = decltype(in_block_)::value_type;
  std::size_t sum = whole_.bytes() + mesh_.bytes() + in_block_.capacity() * sizeof(Ids);
  for (const Ids& ids : in_block_) sum += ids.capacity() * sizeof(Ids::value_type);
  for (const auto& [id, member] : members_) sum += sizeof(member) + member.blocks.capacity() * 4;
  return sum;
}

}  // namespace twofold
