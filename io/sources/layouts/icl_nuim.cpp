#include "io/sources/layouts/icl_nuim.hpp"

#include <string_view>
#include <vector>

#include "io/files/trajectory_file.hpp"

namespace twofold {
namespace fs = std::filesystem;

fs::path icl_nuim_truth_file(const fs::path& folder) {
  constexpr std::string_view kEnd = ".gt.freiburg";
  std::vector<fs::path> found;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (entry.path().filename().string().ends_with(kEnd)) found.push_back(entry.path());
  return found.size() == 1 ? found[0] : fs::path();
}

Trajectory read_icl_nuim_trajectory(const fs::path& file) {
  Trajectory truth = read_tum_trajectory(file);
  for (TimedPose& pose : truth) {
    // M (R, t) M with M = diag(1, -1, 1): a rotation about a mirrored axis turns the other way.
    const Eigen::Quaterniond q = pose.T_w_c.so3().quaternion();
    const Vector3 t = pose.T_w_c.translation();
    pose.T_w_c = SE3(SO3(Eigen::Quaterniond(q.w(), -q.x(), q.y(), -q.z())), Vector3(t.x(), -t.y(), t.z()));
    pose.t_ns /= kIclNuimFps;
  }
  return truth;
}

}  // namespace twofold
