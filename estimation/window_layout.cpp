#include "estimation/window_layout.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "estimation/observation_model.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

/// By insertion: tracks are short and almost in order.
void sort_by_slot(WindowLayout::Observation* first, int count) {
  for (int n = 1; n < count; ++n) {
    if (first[n - 1].slot <= first[n].slot) continue;
    const WindowLayout::Observation moved = first[n];
    int m = n;
    for (; m > 0 && first[m - 1].slot > moved.slot; --m) first[m] = first[m - 1];
    first[m] = moved;
  }
}

std::size_t triangle_size(int rows) {
  return static_cast<std::size_t>(rows) * (rows + 1) / 2;
}

}  // namespace

void WindowLayout::build(const WindowProblem& problem, BlockCholesky& system) {
  sort_points(problem);
  set_pattern(problem, system);
  entry_slots_.clear();
  entry_slots_.reserve(observations_.size());
  std::size_t blocks = 0;
  for (Group& group : groups_) {
    sort_slots(group);
    sort_observations(group);
    group.first_block = blocks;
    blocks += triangle_size(group.coupled_count);
  }
  blocks_.resize(blocks);
  for (Group& group : groups_) find_blocks(group, system);
  place_constraints(problem, system);
}

/// Groups, by a counting sort of the points by anchor.
void WindowLayout::sort_points(const WindowProblem& problem) {
  const std::size_t poses = problem.poses.size();
  groups_.clear();
  slots_.clear();
  tracks_.clear();
  observations_.clear();
  observations_.reserve(problem.observations.size());
  tracks_.reserve(problem.points.size());
  slot_of_pose_.assign(poses, -1);
  coupled_ = CouplingPattern(static_cast<int>(poses));
  involved_.assign(poses, 0);
  rotations_.clear();
  for (const auto& pose : problem.poses) rotations_.push_back(pose.T_k_w.rotation());

  const auto usable = [](const WindowProblem::Point& point) { return point.psi.z() > 0; };
  std::vector<int> begin(poses + 1, 0);
  for (const auto& point : problem.points) begin[point.anchor + 1] += usable(point);
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<int> by_anchor(begin.back());
  std::vector<int> next(begin.begin(), begin.end() - 1);
  for (std::size_t k = 0; k < problem.points.size(); ++k) {
    if (usable(problem.points[k])) by_anchor[next[problem.points[k].anchor]++] = static_cast<int>(k);
  }
  for (std::size_t a = 0; a < poses; ++a) {
    if (begin[a] == begin[a + 1]) continue;
    const int count = begin[a + 1] - begin[a];
    collect_group(problem, static_cast<int>(a), std::span(by_anchor).subspan(begin[a], count));
  }
}

/// Slots and usable observations of the points anchored in one pose.
void WindowLayout::collect_group(const WindowProblem& problem, int anchor, std::span<const int> points) {
  const Matrix3& R_a_w = rotations_[anchor];
  const Vector3& t_a_w = problem.poses[anchor].T_k_w.translation();
  Group group{};
  group.anchor = anchor;
  group.first_slot = static_cast<int>(slots_.size());
  group.first_track = static_cast<int>(tracks_.size());
  // Depth of a point in a pose: third row of T_ia, kept with the slot while the group is read.
  std::vector<Vector3> depth_row;
  std::vector<double> depth_shift;
  for (const int k : points) {
    const auto& point = problem.points[k];
    const Vector3 y = from_inverse_depth(point.psi);
    Track track{k, static_cast<int>(observations_.size()), 0, 0, 0};
    for (int n = 0; n < point.observation_count; ++n) {
      const auto& o = problem.observations[point.first_observation + n];
      int& slot = slot_of_pose_[o.pose];
      if (slot < 0) {
        slot = group.slot_count++;
        slots_.push_back({o.pose, -1, false, -1, false});
        const Vector3 row =
            o.pose == anchor ? Vector3::UnitZ() : Vector3(R_a_w * rotations_[o.pose].row(2).transpose());
        depth_row.push_back(row);
        depth_shift.push_back(
            o.pose == anchor ? 0 : problem.poses[o.pose].T_k_w.translation().z() - row.dot(t_a_w));
      }
      if (!(depth_row[slot].dot(y) + depth_shift[slot] > 2 * kSolverMinDepth)) continue;
      // Only a measurement that counts couples: a pose all of whose points are behind it has no place in the
      // system.
      const bool both_fixed = problem.poses[o.pose].fixed && problem.poses[anchor].fixed;
      slots_[group.first_slot + slot].coupled = o.pose != anchor && !both_fixed;
      observations_.push_back({o.pixel, o.information, slot, -1});
      ++track.observation_count;
    }
    if (track.observation_count == 0) continue;
    tracks_.push_back(track);
    mark_coupled(group, track);
  }
  for (int s = 0; s < group.slot_count; ++s) slot_of_pose_[slots_[group.first_slot + s].pose] = -1;
  group.track_count = static_cast<int>(tracks_.size()) - group.first_track;
  groups_.push_back(group);
}

/// Eliminating a point couples all poses that its measurements depend on.
void WindowLayout::mark_coupled(const Group& group, const Track& track) {
  const Slot* slots = &slots_[group.first_slot];
  const Observation* observations = &observations_[track.first_observation];
  for (int m = 0; m < track.observation_count; ++m) {
    const Slot& slot = slots[observations[m].slot];
    if (!slot.coupled) continue;
    involved_[slot.pose] = involved_[group.anchor] = 1;
    coupled_.couple(slot.pose, group.anchor);
    for (int n = 0; n < m; ++n) {
      const Slot& other = slots[observations[n].slot];
      if (other.coupled && other.pose != slot.pose) coupled_.couple(slot.pose, other.pose);
    }
  }
}

void WindowLayout::set_pattern(const WindowProblem& problem, BlockCholesky& system) {
  for (const auto& c : problem.constraints) {
    involved_[c.i] = involved_[c.j] = 1;
    coupled_.couple(c.i, c.j);
  }
  const int poses = static_cast<int>(problem.poses.size());
  std::vector<int> unknown(poses, -1);
  int count = 0;
  for (int i = 0; i < poses; ++i) {
    if (involved_[i] != 0 && !problem.poses[i].fixed) unknown[i] = count++;
  }
  CouplingPattern pattern(count);
  for (int i = 0; i < poses; ++i) {
    if (unknown[i] < 0) continue;
    coupled_.for_each_after(i, [&](int j) {
      if (unknown[j] >= 0) pattern.couple(unknown[i], unknown[j]);
    });
  }
  system.set_pattern(std::move(pattern));
  position_.assign(poses, -1);
  for (int i = 0; i < poses; ++i) {
    if (unknown[i] >= 0) position_[i] = system.position()[unknown[i]];
  }
}

/// Renumbers the slots of a group, coupled ones first and in elimination order, so that products of its
/// points go to the lower triangle of the reduced system as they are.
void WindowLayout::sort_slots(Group& group) {
  Slot* slots = &slots_[group.first_slot];
  group.anchor_position = position_[group.anchor];
  unsorted_.assign(slots, slots + group.slot_count);
  for (Slot& slot : unsorted_) slot.position = position_[slot.pose];
  std::vector<int>& order = rows_;
  order.resize(group.slot_count);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [this](int a, int b) {
    const auto rank = [this](int s) {
      return std::make_tuple(unsorted_[s].coupled ? 0 : 1, unsorted_[s].position, s);
    };
    return rank(a) < rank(b);
  });
  renamed_.resize(group.slot_count);
  for (int s = 0; s < group.slot_count; ++s) {
    renamed_[order[s]] = s;
    slots[s] = unsorted_[order[s]];
    group.coupled_count += slots[s].coupled;
  }
}

/// Brings the observations of each track into the order of the slots, and counts its couplings.
void WindowLayout::sort_observations(const Group& group) {
  for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
    Track& track = tracks_[k];
    Observation* observations = &observations_[track.first_observation];
    for (int n = 0; n < track.observation_count; ++n) observations[n].slot = renamed_[observations[n].slot];
    sort_by_slot(observations, track.observation_count);
    track.first_entry = static_cast<int>(entry_slots_.size());
    for (int n = 0; n < track.observation_count; ++n) {
      Observation& o = observations[n];
      if (o.slot >= group.coupled_count) break;
      if (n == 0 || observations[n - 1].slot != o.slot) {
        entry_slots_.push_back(o.slot);
        ++track.entry_count;
      }
      o.entry = track.entry_count - 1;
    }
  }
}

/// Where the blocks of a group's slots stand in the reduced system.
void WindowLayout::find_blocks(Group& group, BlockCholesky& system) {
  Slot* slots = &slots_[group.first_slot];
  int* blocks = blocks_.data() + group.first_block;
  int fixed = 0;  // they come first
  while (fixed < group.coupled_count && slots[fixed].position < 0) ++fixed;
  std::fill_n(blocks, triangle_size(fixed), -1);
  rows_.resize(group.coupled_count);
  for (int s = 0; s < group.coupled_count; ++s) rows_[s] = slots[s].position;
  column_blocks_.resize(group.coupled_count);
  for (int column = 0; column < group.coupled_count; ++column) {
    const std::size_t below = group.coupled_count - column;
    const std::span<int> found = std::span(column_blocks_).first(below);
    if (column < fixed) {
      std::fill(found.begin(), found.end(), -1);
    } else {
      system.block_indices(rows_[column], std::span(rows_).last(below), found);
    }
    for (int row = column; row < group.coupled_count; ++row) {
      blocks[triangle_size(row) + column] = found[row - column];
    }
  }
  if (group.anchor_position < 0) return;
  for (Slot* slot = slots + fixed; slot != slots + group.coupled_count; ++slot) {
    slot->anchor_is_row = group.anchor_position > slot->position;
    slot->anchor_block = system.block_index(std::max(group.anchor_position, slot->position),
                                            std::min(group.anchor_position, slot->position));
  }
}

void WindowLayout::place_constraints(const WindowProblem& problem, const BlockCholesky& system) {
  constraints_.clear();
  constraints_.reserve(problem.constraints.size());
  for (const auto& c : problem.constraints) {
    const int i = position_[c.i], j = position_[c.j];
    const bool both_free = i >= 0 && j >= 0;
    constraints_.push_back({i, j, both_free ? system.block_index(std::max(i, j), std::min(i, j)) : -1});
  }
}

}  // namespace twofold
