#pragma once

#include <string>

#include "loopclosure/vocabulary.hpp"

namespace twofold {

struct PlaceEvaluationArguments {
  std::string set;            ///< folder of images, or a source
  std::string pairs;          ///< file or list of true pairs; empty: from the source's poses
  int tolerance = 0;          ///< images
  int gap = 20;               ///< images
  double max_distance = 1.0;  ///< [m]
  double max_angle_deg = 30;
  int every = 1;
  std::string plot;
  std::string csv;  ///< where each candidate got to in recognition and verification
};

/// Asks for each image of the set which earlier one shows the same place, and prints precision and recall of
/// the answers: of recognition alone, over its threshold, and, where depth is known, after geometric
/// verification. Throws IoError.
void evaluate_places(const PlaceEvaluationArguments& arguments, const Vocabulary& vocabulary);

}  // namespace twofold
