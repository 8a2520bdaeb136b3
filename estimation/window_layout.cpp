#include "estimation/window_layout.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "estimation/observation_model.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

/// Symmetric relation between n unknowns, a bit a pair.
class BitMatrix {
 public:
  explicit BitMatrix(int n) : n_(n), words_((n + 63) / 64), bits_(static_cast<std::size_t>(n) * words_, 0) {}
  void set(int i, int j) {
    if (i > j) std::swap(i, j);
    bits_[static_cast<std::size_t>(i) * words_ + j / 64] |= std::uint64_t{1} << (j % 64);
  }
  /// For each i the j > i related to it, rising.
  [[nodiscard]] std::vector<std::vector<int>> lists() const {
    std::vector<std::vector<int>> result(n_);
    for (int i = 0; i < n_; ++i) {
      for (int w = 0; w < words_; ++w) {
        auto word = bits_[static_cast<std::size_t>(i) * words_ + w];
        for (; word != 0; word &= word - 1) {
          const int j = 64 * w + __builtin_ctzll(word);
          if (j != i) result[i].push_back(j);
        }
      }
    }
    return result;
  }

 private:
  int n_, words_;
  std::vector<std::uint64_t> bits_;
};

/// By insertion: tracks are short and almost in order.
void sort_by_slot(WindowLayout::Observation* first, int count) {
  for (int n = 1; n < count; ++n) {
    const WindowLayout::Observation moved = first[n];
    int m = n;
    for (; m > 0 && first[m - 1].slot > moved.slot; --m) first[m] = first[m - 1];
    first[m] = moved;
  }
}

int triangle_index(int row, int column) {
  return row * (row + 1) / 2 + column;
}

}  // namespace

void WindowLayout::build(const WindowProblem& problem, BlockCholesky& system) {
  groups_.clear();
  slots_.clear();
  tracks_.clear();
  observations_.clear();
  pairs_.clear();
  entry_slots_.clear();
  slot_of_pose_.assign(problem.poses.size(), -1);
  sort_points(problem);
  for (Group& group : groups_) find_pairs(group);
  set_pattern(problem, system);
  for (Group& group : groups_) sort_slots(group, system);
}

void WindowLayout::sort_points(const WindowProblem& problem) {
  std::vector<std::vector<int>> by_anchor(problem.poses.size());
  for (std::size_t k = 0; k < problem.points.size(); ++k) {
    if (problem.points[k].psi.z() > 0) by_anchor[problem.points[k].anchor].push_back(static_cast<int>(k));
  }
  observations_.reserve(problem.observations.size());
  tracks_.reserve(problem.points.size());
  for (std::size_t a = 0; a < by_anchor.size(); ++a) {
    if (!by_anchor[a].empty()) collect_group(problem, static_cast<int>(a), by_anchor[a]);
  }
}

/// Slots and usable observations of the points anchored in one pose.
void WindowLayout::collect_group(const WindowProblem& problem, int anchor, const std::vector<int>& points) {
  const ObservationModel model(problem.rig);
  const SE3 T_w_a = problem.poses[anchor].T_k_w.inverse();
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
        const SE3 T_i_a = o.pose == anchor ? SE3() : problem.poses[o.pose].T_k_w * T_w_a;
        depth_row.push_back(T_i_a.rotation().row(2));
        depth_shift.push_back(T_i_a.translation().z());
      }
      if (!(depth_row[slot].dot(y) + depth_shift[slot] > 2 * kMinDepth)) continue;
      // Only a measurement that counts couples: a pose all of whose points are behind it has no place in the system.
      const bool both_held = problem.poses[o.pose].fixed && problem.poses[anchor].fixed;
      slots_[group.first_slot + slot].coupled = o.pose != anchor && !both_held;
      observations_.push_back({o.z, o.information, slot, -1});
      ++track.observation_count;
    }
    if (track.observation_count > 0) tracks_.push_back(track);
  }
  for (int s = 0; s < group.slot_count; ++s) slot_of_pose_[slots_[group.first_slot + s].pose] = -1;
  group.track_count = static_cast<int>(tracks_.size()) - group.first_track;
  groups_.push_back(group);
}

/// Which slots have a point in common.
void WindowLayout::find_pairs(Group& group) {
  const Slot* slots = &slots_[group.first_slot];
  seen_together_.assign(triangle_index(group.slot_count, 0), 0);
  for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
    const Observation* track = &observations_[tracks_[k].first_observation];
    for (int m = 0; m < tracks_[k].observation_count; ++m) {
      const int s = track[m].slot;
      if (!slots[s].coupled) continue;
      for (int n = 0; n <= m; ++n) {
        const int r = track[n].slot;
        if (slots[r].coupled) seen_together_[triangle_index(std::max(r, s), std::min(r, s))] = 1;
      }
    }
  }
  group.first_pair = static_cast<int>(pairs_.size());
  for (int row = 0; row < group.slot_count; ++row) {
    for (int column = 0; column <= row; ++column) {
      if (seen_together_[triangle_index(row, column)] != 0) pairs_.push_back({row, column, -1});
    }
  }
  group.pair_count = static_cast<int>(pairs_.size()) - group.first_pair;
}

void WindowLayout::set_pattern(const WindowProblem& problem, BlockCholesky& system) {
  std::vector<char> involved(problem.poses.size(), 0);
  for (const Group& group : groups_) {
    for (int p = group.first_pair; p < group.first_pair + group.pair_count; ++p) {
      involved[slots_[group.first_slot + pairs_[p].row].pose] = 1;
      involved[group.anchor] = 1;
    }
  }
  for (const auto& c : problem.constraints) involved[c.i] = involved[c.j] = 1;

  std::vector<int> unknown(problem.poses.size(), -1);
  int count = 0;
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    if (involved[i] != 0 && !problem.poses[i].fixed) unknown[i] = count++;
  }
  BitMatrix coupled(count);
  const auto couple = [&](int pose_1, int pose_2) {
    if (unknown[pose_1] >= 0 && unknown[pose_2] >= 0) coupled.set(unknown[pose_1], unknown[pose_2]);
  };
  for (const Group& group : groups_) {
    for (int p = group.first_pair; p < group.first_pair + group.pair_count; ++p) {
      const int row_pose = slots_[group.first_slot + pairs_[p].row].pose;
      couple(row_pose, slots_[group.first_slot + pairs_[p].column].pose);
      couple(row_pose, group.anchor);
    }
  }
  for (const auto& c : problem.constraints) couple(c.i, c.j);
  system.set_pattern(coupled.lists());

  position_.assign(problem.poses.size(), -1);
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    if (unknown[i] >= 0) position_[i] = system.position()[unknown[i]];
  }
}

/// Renumbers the slots of a group, coupled ones first and in elimination order, so that blocks of the group
/// go to the lower triangle of the reduced system as they are.
void WindowLayout::sort_slots(Group& group, const BlockCholesky& system) {
  Slot* slots = &slots_[group.first_slot];
  group.anchor_position = position_[group.anchor];
  for (int s = 0; s < group.slot_count; ++s) slots[s].position = position_[slots[s].pose];
  std::vector<int> order(group.slot_count);
  for (int s = 0; s < group.slot_count; ++s) order[s] = s;
  const auto rank = [slots](int s) { return std::make_pair(slots[s].coupled ? 0 : 1, slots[s].position); };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return rank(a) < rank(b); });
  std::vector<int> renamed(group.slot_count);
  std::vector<Slot> sorted(group.slot_count);
  for (int s = 0; s < group.slot_count; ++s) {
    renamed[order[s]] = s;
    sorted[s] = slots[order[s]];
    group.coupled_count += sorted[s].coupled;
    if (sorted[s].coupled && sorted[s].position >= 0 && group.anchor_position >= 0) {
      sorted[s].anchor_is_row = group.anchor_position > sorted[s].position;
      sorted[s].anchor_block = system.block_index(std::max(group.anchor_position, sorted[s].position),
                                                  std::min(group.anchor_position, sorted[s].position));
    }
  }
  std::copy(sorted.begin(), sorted.end(), slots);

  for (int p = group.first_pair; p < group.first_pair + group.pair_count; ++p) {
    const int a = renamed[pairs_[p].row], b = renamed[pairs_[p].column];
    Pair& pair = pairs_[p] = {std::max(a, b), std::min(a, b), -1};
    if (slots[pair.row].position >= 0 && slots[pair.column].position >= 0) {
      pair.block = system.block_index(slots[pair.row].position, slots[pair.column].position);
    }
  }
  for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
    Track& track = tracks_[k];
    Observation* observations = &observations_[track.first_observation];
    for (int n = 0; n < track.observation_count; ++n) observations[n].slot = renamed[observations[n].slot];
    sort_by_slot(observations, track.observation_count);
    track.first_entry = static_cast<int>(entry_slots_.size());
    for (int n = 0; n < track.observation_count; ++n) {
      Observation& o = observations[n];
      if (!slots[o.slot].coupled) continue;
      if (n == 0 || observations[n - 1].slot != o.slot) {
        entry_slots_.push_back(o.slot);
        ++track.entry_count;
      }
      o.entry = track.entry_count - 1;
    }
  }
}

}  // namespace twofold
