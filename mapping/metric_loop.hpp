#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "estimation/motion_only.hpp"
#include "graph/graph_writer.hpp"
#include "graph/neighbourhood.hpp"
#include "imaging/guided_search.hpp"
#include "mapping/double_window.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// Looks for a map point in the images of a keyframe; T_k_a is the keyframe's pose relative to the point's
/// anchor.
using PointSearch = std::function<std::optional<PointMatch>(const FrameImages& images, PointId id,
                                                            const MapPoint& point, const SE3& T_k_a)>;

/// find_point with the given radius.
[[nodiscard]] PointSearch guided_point_search(const Rig& rig, double radius_px);

struct MetricLoopReport {
  int searched = 0;      ///< points of A, after spreading
  int found = 0;         ///< measured in the reference keyframe
  int agreed = 0;        ///< explained by T_loop
  int edges = 0;         ///< keyframes newly connected to the reference
  int observations = 0;  ///< added to the reference

  MetricLoopReport& operator+=(const MetricLoopReport& other);
};

/// Metric loop closure  (thesis 6.4.1): finds points of the wider neighbourhood N2 that N1 does not see in
/// the reference keyframe, and connects the reference with the keyframes that see them too.
///
/// It knows no scale. The unit of one camera drifts on the way, and what has drifted must not be tied
/// together without a change of scale: such loops are left to recognition by appearance, whose are closed
/// over Sim(3) (thesis 6.2.7). So N2 has members only that a short way along the window's tree leads to.
class MetricLoopCloser {
 public:
  MetricLoopCloser(const Rig& rig, const MapperOptions& options, PointSearch search);

  /// @param window    double window around the newest keyframe; its poses agree with one another, its first
  ///                  nodes are N2
  /// @param keyframe  the reference: the newest keyframe, or one that was inserted together with it
  /// @param images    of that keyframe
  MetricLoopReport close(GraphWriter& writer, const DoubleWindow& window, KeyframeId keyframe,
                         const FrameImages& images);

 private:
  struct Candidate {
    PointId id = kNoPoint;
    Vector3 x_w{0, 0, 0};
  };

  void split_neighbourhoods(const GraphSnapshot& graph, const DoubleWindow& window);
  void measure_ways(const GraphSnapshot& graph, const DoubleWindow& window, std::size_t count);
  void collect_candidates(const GraphSnapshot& graph);
  void search_candidates(const GraphSnapshot& graph, const FrameImages& images);
  [[nodiscard]] std::optional<SE3> estimate_pose(const SE3& T_ref_w);
  void prune(const SE3& T_loop_w);
  [[nodiscard]] bool well_spread(const std::vector<std::size_t>& matches) const;
  void connect(GraphWriter& writer, const SE3& T_loop_w, MetricLoopReport& report);

  Rig rig_;
  int min_matches_;
  bool scale_drifts_;
  MetricLoopOptions options_;
  PointSearch search_;

  KeyframeId reference_ = kNoKeyframe;
  std::vector<KeyframeId> near_;  ///< N1
  std::vector<KeyframeId> far_;   ///< N2 without N1
  std::vector<double> ways_;      ///< from the reference to the members of N2, along the window's tree
  VisitedSet visited_;            ///< points seen from N1, and those met
  std::vector<PointId> near_points_;
  std::vector<int> taken_;             ///< candidates by cell of the image
  std::vector<Candidate> candidates_;  ///< A
  std::vector<Observation> found_;     ///< measurements of candidates_, in step with motion_
  std::vector<MotionObservation> motion_;
  IdMap found_position_;
};

}  // namespace twofold
