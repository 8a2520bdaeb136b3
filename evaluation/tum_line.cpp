#include "evaluation/tum_line.hpp"

#include <fmt/format.h>

namespace twofold {

std::string seconds_text(std::int64_t t_ns) {
  constexpr std::uint64_t kSecond = 1'000'000'000;
  const auto bits = static_cast<std::uint64_t>(t_ns);
  const std::uint64_t size = t_ns < 0 ? 0 - bits : bits;
  return fmt::format("{}{}.{:09}", t_ns < 0 ? "-" : "", size / kSecond, size % kSecond);
}

std::string tum_line(const TimedPose& pose) {
  const Vector3& t = pose.T_w_c.translation();
  Eigen::Quaterniond q = pose.T_w_c.so3().quaternion();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", seconds_text(pose.t_ns), t.x(),
                     t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace twofold
