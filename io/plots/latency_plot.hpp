#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "io/files/timing_file.hpp"

namespace twofold {

/// One panel a stage that any run passed: the share of its durations that were longer (down, log scale) than
/// a duration (to the right, log scale), a line a run. A p99 is read off where the line crosses 1 %; a
/// straight drop is a stage without a tail. CV_8UC3; runs must not be empty.
[[nodiscard]] cv::Mat draw_latencies(const std::vector<TimingFile>& runs);

}  // namespace twofold
