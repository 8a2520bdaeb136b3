#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "camera/measurement.hpp"
#include "estimation/window_problem.hpp"
#include "sparse/block_cholesky.hpp"

namespace twofold {

/// A WindowProblem sorted for the solver: points by anchor, and each anchor's points against the poses
/// relative to that anchor.
///
/// An observation of pose i depends on T_i and T_a only through T_ia = T_i T_a^-1, and to first order on
/// xi = delta_i - Ad(T_ia) delta_a alone. So all points of one anchor are eliminated in the coordinates xi of
/// its observers ("slots"), with one 6-dof pose an observation, and only the sum goes on to the absolute
/// poses.
///
/// Observations behind their camera at the start are left out for good: they have no useful derivative, and
/// leaving them in would forbid every step.
class WindowLayout {
 public:
  /// Motion of one observing pose against the anchor.
  struct Slot {
    int pose = 0;
    int position = -1;           ///< in the elimination order; -1: fixed
    bool coupled = false;        ///< xi is not always zero: neither the anchor itself nor both poses fixed
    int anchor_block = -1;       ///< block of (slot, anchor) in the reduced system, if both are free
    bool anchor_is_row = false;  ///< that block has the anchor as row
  };
  struct Observation {
    StereoPixelF pixel;
    Eigen::Vector3f information;
    int slot;   ///< in the group
    int entry;  ///< coupling of the point with that slot; -1 for slots that are not coupled
  };
  struct Track {
    int point;  ///< in the problem
    int first_observation, observation_count;
    int first_entry, entry_count;
  };
  struct Group {
    int anchor;           ///< pose
    int anchor_position;  ///< in the elimination order; -1: fixed
    int first_slot, slot_count;
    int coupled_count;  ///< coupled slots come first, free ones in elimination order
    int first_track, track_count;
    std::size_t first_block;  ///< of its part of blocks()
  };
  /// Where a pose-pose constraint goes in the reduced system.
  struct ConstraintPlace {
    int i, j;   ///< positions; -1: fixed
    int block;  ///< of (i, j), or (j, i) if that is the lower one; -1 unless both are free
  };

  /// Sorts the problem, and gives `system` the pattern of its reduced system.
  void build(const WindowProblem& problem, BlockCholesky& system);

  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }
  [[nodiscard]] const std::vector<Slot>& slots() const { return slots_; }
  [[nodiscard]] const std::vector<Track>& tracks() const { return tracks_; }
  [[nodiscard]] const std::vector<Observation>& observations() const { return observations_; }
  /// Blocks of the reduced system for pairs of coupled slots, of each group the lower triangle row by row; -1
  /// unless both slots are free and a point may be seen from both.
  [[nodiscard]] const std::vector<int>& blocks() const { return blocks_; }
  /// Slot, in the group, of each entry.
  [[nodiscard]] const std::vector<int>& entry_slots() const { return entry_slots_; }
  [[nodiscard]] const std::vector<ConstraintPlace>& constraints() const { return constraints_; }
  /// Place of a pose in the elimination order; -1 when it is fixed or nothing depends on it.
  [[nodiscard]] int position(int pose) const { return position_[pose]; }

 private:
  void sort_points(const WindowProblem& problem);
  void collect_group(const WindowProblem& problem, int anchor, std::span<const int> points);
  void mark_coupled(const Group& group, const Track& track);
  void set_pattern(const WindowProblem& problem, BlockCholesky& system);
  void sort_slots(Group& group);
  void sort_observations(const Group& group);
  void find_blocks(Group& group, BlockCholesky& system);
  void place_constraints(const WindowProblem& problem, const BlockCholesky& system);

  std::vector<Group> groups_;
  std::vector<Slot> slots_;
  std::vector<Track> tracks_;
  std::vector<Observation> observations_;
  std::vector<int> blocks_;
  std::vector<ConstraintPlace> constraints_;
  std::vector<int> entry_slots_;
  std::vector<int> position_;
  // Scratch:
  std::vector<Matrix3> rotations_;  // of the poses
  std::vector<int> slot_of_pose_;
  CouplingPattern coupled_;     // of poses by points
  std::vector<char> involved_;  // poses that something depends on
  std::vector<int> renamed_, rows_, column_blocks_;
  std::vector<Slot> unsorted_;
};

}  // namespace twofold
