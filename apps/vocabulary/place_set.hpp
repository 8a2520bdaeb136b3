#pragma once

#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apps/vocabulary/place_evaluation.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "loopclosure/described_place.hpp"

namespace twofold {

/// An image of a set, described.
struct DescribedImage {
  DescribedPlace view;
  std::optional<SE3> T_w_c;  ///< true pose, if known
};

struct PlaceSet {
  Rig rig;
  std::vector<DescribedImage> places;
};

/// Describes every `arguments.every`-th image of a folder that has a folder `images`, which are of one
/// camera, or of a source. Throws IoError.
[[nodiscard]] PlaceSet load_place_set(const PlaceEvaluationArguments& arguments,
                                      const Vocabulary& vocabulary);

enum class Truth : std::uint8_t { kSame, kOther, kUndecided };

/// Which images show the same place: by a list of pairs, or by true poses.
class TruePairs {
 public:
  /// Both must outlive this. Throws IoError when neither pairs nor poses are there.
  TruePairs(const PlaceEvaluationArguments& arguments, const PlaceSet& set);

  [[nodiscard]] Truth of(int a, int b) const;
  /// How far two images with true poses were taken apart: 1 is the bound of what is the same place, once in
  /// distance and once in angle.
  [[nodiscard]] double separation(int a, int b) const;

 private:
  struct Separation {
    double distance, angle;  ///< in units of the bounds
  };

  void parse(const std::string& text);
  [[nodiscard]] Separation between(int a, int b) const;
  [[nodiscard]] Truth from_poses(int a, int b) const;

  const PlaceEvaluationArguments& arguments_;
  const PlaceSet& set_;
  std::set<std::pair<int, int>> pairs_;
};

}  // namespace twofold
