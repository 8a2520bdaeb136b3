#include "camera/opencv_distortion.hpp"

#include <algorithm>
#include <array>

namespace twofold {
namespace {

constexpr std::size_t kRadTanCount = 5, kRationalCount = 8, kEquidistantCount = 4;

bool all_zero(std::span<const double> coefficients) {
  return std::all_of(coefficients.begin(), coefficients.end(), [](double k) { return k == 0; });
}

}  // namespace

tl::expected<Distortion, std::string> opencv_distortion(std::span<const double> k) {
  constexpr std::array<std::size_t, 5> kCounts{4, kRadTanCount, kRationalCount, 12, 14};
  if (std::find(kCounts.begin(), kCounts.end(), k.size()) == kCounts.end())
    return tl::make_unexpected("has " + std::to_string(k.size()) + " coefficients, not 4, 5, 8, 12 or 14");
  const auto used = k.first(std::min(k.size(), kRationalCount));
  if (!all_zero(k.subspan(used.size())))
    return tl::make_unexpected(
        "has a thin prism or a tilted sensor, coefficients 9 to 14, which are not supported unless zero");
  Distortion distortion;
  const bool quotient = used.size() == kRationalCount && !all_zero(used.subspan(kRadTanCount));
  distortion.model = quotient ? DistortionModel::kRational : DistortionModel::kRadTan;
  std::copy(used.begin(), used.end(), distortion.coefficients.begin());
  return distortion;
}

tl::expected<Distortion, std::string> equidistant_distortion(std::span<const double> k) {
  if (k.size() < kEquidistantCount || !all_zero(k.subspan(kEquidistantCount)))
    return tl::make_unexpected("has " + std::to_string(k.size()) + " coefficients, equidistant has 4");
  Distortion distortion{DistortionModel::kEquidistant, {}};
  std::copy_n(k.begin(), kEquidistantCount, distortion.coefficients.begin());
  return distortion;
}

}  // namespace twofold
