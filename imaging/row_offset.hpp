#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "imaging/fast_corners.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {

/// How many rows lower than in the left image a point lies in the right one. None in a rectified pair; a
/// mount that was bent, or a calibration of another day, makes some.
struct RowOffset {
  double rows = 0;
  int matches = 0;  ///< corners it was measured at
};

struct RowOffsetOptions {
  int corner_threshold = 10;    ///< FAST [grey], >= 1
  float min_corner_score = 12;  ///< Shi-Tomasi [grey^2/px^2], >= 0
  int min_matches = 16;         ///< corners found in both images: fewer say nothing, >= 1
  double max_spread_px = 0.6;   ///< half the distance between quartiles: more is no common offset, > 0
  /// From the whole offset searched with: where most corners are found, they are found about there, > 0.
  double max_apart_px = 0.7;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Measures it, at corners spread over the image. Buffers are reserved at construction; bounded work.
class RowOffsetMeter {
 public:
  /// Beyond this no offset is looked for [px].
  static constexpr int kMost = 4;

  /// @param corners  about so many are looked at, 40 to 200
  RowOffsetMeter(const Rig& rig, int corners, const RowOffsetOptions& options = {});

  /// If the rows are at most about one apart: corners are found along their row, and then aligned across it.
  /// @return nothing when few corners are found, or where they are found differs too much
  [[nodiscard]] std::optional<RowOffset> measure(const cv::Mat& left, const cv::Mat& right);
  /// The same for up to kMost rows: of all whole offsets that with which most corners are found.
  [[nodiscard]] std::optional<RowOffset> search(const cv::Mat& left, const cv::Mat& right);

 private:
  std::optional<RowOffset> measure_at(const cv::Mat& left, const cv::Mat& right, int offset);

  Rig rig_;
  RowOffsetOptions options_;
  GuidedSearchOptions search_;
  int cell_px_ = 0, columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> occupied_;  ///< nothing is
  std::vector<Corner> corners_;
  std::vector<double> offsets_;  ///< of each corner found [px]
};

/// Moves a right image's rows up by `offset` rows, between whole ones by linear interpolation; beyond the
/// edge its last row goes on. `out` keeps its memory.
void take_back_row_offset(const cv::Mat& right, double offset, cv::Mat& out);
/// The same in an image of its own; without an offset, the right image itself.
[[nodiscard]] cv::Mat without_row_offset(const cv::Mat& right, double offset);

}  // namespace twofold
