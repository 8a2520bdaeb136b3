#include "doctor/stereo_rows.hpp"

#include <fmt/format.h>

#include <cmath>
#include <span>
#include <vector>

#include "base/median.hpp"
#include "imaging/right_rows.hpp"

namespace twofold {
namespace {

constexpr const char* kRemedy = "calibrate the pair again (twofold calibrate)";

double median_rows(std::span<const RowOffset> offsets) {
  std::vector<double> rows;
  for (const RowOffset& offset : offsets) rows.push_back(offset.rows);
  return median(std::span(rows));
}

}  // namespace

Finding check_rows(std::span<const RowOffset> offsets) {
  const std::string subject = "stereo rows";
  if (offsets.empty()) {
    return {Health::kWarn, subject, "too little is found in both images to tell",
            "show the camera something with texture; if that does not help, " + std::string(kRemedy)};
  }
  const double rows = median_rows(offsets);
  const std::string state = fmt::format("right images lie {:.2f} rows {} than left ones", std::abs(rows),
                                        rows > 0 ? "lower" : "higher");
  const double left_alone = RightRowsOptions{}.significant_px;  // by runs
  if (std::abs(rows) <= left_alone) return {Health::kOk, subject, state, ""};
  return {Health::kWarn, subject, state, std::string(kRemedy) + "; runs shift the rows until then"};
}

}  // namespace twofold
