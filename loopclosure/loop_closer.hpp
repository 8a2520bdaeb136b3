#pragma once

#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "graph/keyframe_database.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/loop_constraint.hpp"
#include "loopclosure/depth_regression.hpp"
#include "loopclosure/described_place.hpp"
#include "loopclosure/geometric_verification.hpp"
#include "loopclosure/loop_probation.hpp"
#include "loopclosure/place_recogniser.hpp"
#include "loopclosure/pose_refinement.hpp"
#include "loopclosure/redundant_loop.hpp"

namespace twofold {

struct LoopCloserOptions {
  CornerSelectionOptions corners;
  RecogniserOptions recogniser;
  VerificationOptions verification;
  RefinementOptions refinement;
  ProbationOptions probation;
  RedundantLoopOptions redundant;
  int place_views = 5;                 ///< keyframes of N1 whose corners are a place's, itself included, >= 1
  int relocalisation_candidates = 10;  ///< places tried for a lost camera, >= 1
  /// Of the points that a loop explains beside where the map has the camera: if as many are found from there
  /// on, that is where it is, in [0, 1].
  double as_mapped_share = 0.8;
  /// Standard deviation of a loop's position within one part of the map, > 0: share of the scene's median
  /// depth. Real loops were known to 0.0002 to 0.009 of it, also those that corrected metres; those beside
  /// the truth to 0.01 to 0.04.
  double max_sigma = 0.01;
  DepthRegressionOptions depths;  ///< of one camera's corners
  int min_scale_points = 12;      ///< that say how one camera's units differ; with fewer nobody knows, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Where a lost camera is: p_c = T_c_k * p_k.
struct Relocalisation {
  KeyframeId keyframe = kNoKeyframe;
  SE3 T_c_k;
  int inliers = 0;
  int weight = 1;  ///< what they are worth together (RefinedPlace); 1 of a rough pose
  /// Standard deviation of the position [m]; infinite where the map knows too few points to tell: the pose
  /// then hangs on depths of single corners, which is near enough for a camera that is lost.
  double sigma = std::numeric_limits<double>::infinity();
};

/// Large-scale loop closure  (thesis 6.4.2), and relocalisation.
///
/// Remembers how the place of every keyframe looks. Reads snapshots, changes nothing: a loop goes to the
/// mapper as a message. Single-threaded; the same calls give the same answers. A step's cost grows with the
/// inverted file's lists and, when a loop was verified that the map does not know, with the keyframes ever
/// made between its two (DriftModel); memory with the keyframes that are not culled.
///
/// One camera has no depth of its own corners: those of a place follow from the map (DepthRegression), and a
/// loop is a similarity. It needs points of the map around both keyframes. Loops that tell the map nothing
/// are kept to itself (RedundantLoops).
class LoopCloser {
 public:
  LoopCloser(const Rig& rig, std::shared_ptr<const Vocabulary> vocabulary, const LoopCloserOptions& options);

  /// Knows the places of a loaded map from now on. Their words are found anew, so that a map does not depend
  /// on the vocabulary it was made with. To be called before the first step.
  void continue_from(const KeyframeDatabase& places);

  /// Describes and remembers a keyframe that `graph` has, and tells whether its place was seen before, once
  /// that is confirmed. To be called in the order of keyframe ids; ids may be left out.
  [[nodiscard]] std::optional<LoopConstraint> step(const KeyframeProposal& keyframe,
                                                   const GraphSnapshot& graph);

  /// Place of a view of a lost camera, from its images alone.
  [[nodiscard]] std::optional<Relocalisation> relocalise(const FrameImages& images,
                                                         const GraphSnapshot& graph);

  /// What is remembered, to be saved with the map or published.
  [[nodiscard]] const KeyframeDatabase& places() const { return places_; }

 private:
  /// Does the view show the place of keyframe k? First by corners, then by the map's points.
  [[nodiscard]] std::optional<Relocalisation> verify(KeyframeId k, const DescribedPlace& view,
                                                     const FrameImages& images, const GraphSnapshot& graph,
                                                     const std::optional<SE3>& T_mapped = std::nullopt);
  [[nodiscard]] RefinementOutcome refine(const GraphSnapshot& graph, KeyframeId k, const FrameImages& images,
                                         const SE3& T_c_k, const std::optional<SE3>& T_mapped,
                                         RefinedPlace& result);
  [[nodiscard]] std::optional<Relocalisation> first_place(const std::vector<PlaceCandidate>& candidates,
                                                          KeyframeId id, const DescribedPlace& view,
                                                          const FrameImages& images,
                                                          const GraphSnapshot& graph);
  [[nodiscard]] std::optional<Relocalisation> only_place(const std::vector<PlaceCandidate>& candidates,
                                                         const DescribedPlace& view,
                                                         const FrameImages& images,
                                                         const GraphSnapshot& graph);
  [[nodiscard]] std::vector<PlaceCandidate> in_older_parts(KeyframeId id, const BagOfWords& bag,
                                                           const GraphSnapshot& graph);
  [[nodiscard]] const PlaceAppearance* view_of(KeyframeId k, const GraphSnapshot& graph);
  [[nodiscard]] std::span<const PlacedView> views_of_place(KeyframeId k, const GraphSnapshot& graph);
  [[nodiscard]] std::optional<double> scale_of(const Relocalisation& seen) const;
  [[nodiscard]] bool is_exact(const LoopConstraint& loop, double sigma, const GraphSnapshot& graph) const;
  void remember(KeyframeId id, DescribedPlace view);

  Rig rig_;
  std::shared_ptr<const Vocabulary> vocabulary_;
  LoopCloserOptions options_;
  PlaceDescriber describer_;
  PlaceRecogniser recogniser_;
  PoseRefinement refinement_;
  LoopProbation probation_;
  RedundantLoops redundant_;
  KeyframeDatabase places_;
  std::uint32_t oldest_ = 0;  ///< keyframe: all before it are culled
  std::vector<KeyframeId> neighbours_;
  std::vector<PlacedView> views_;
  // One camera only: depths of the keyframe at hand, and the views of keyframes with those that the map gives
  // them. Candidates are neighbours of each other: a view is made once for all of those of one question.
  struct ViewWithDepth {
    KeyframeId keyframe;
    PlaceAppearance view;
  };
  DepthRegression depths_, place_depths_;
  std::deque<ViewWithDepth> views_with_depth_;  // views_ points to them
  std::optional<BagOfWords> previous_;          // of the keyframe described last
};

}  // namespace twofold
