#include "evaluation/tum_line.hpp"

#include <fmt/format.h>

namespace twofold {

std::string tum_line(const TimedPose& pose) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const Vector3& t = pose.T_w_c.translation();
  Eigen::Quaterniond q = pose.T_w_c.so3().quaternion();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  return fmt::format("{}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", pose.t_ns / kSecond,
                     pose.t_ns % kSecond, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace twofold
