// Whether two machines compute the same bits: 200 poses, each from 200 rounded measurements, by the tracker's
// solver. Prints a hash of all bits of poses and information matrices, and a sum that shows by how little two
// hashes differ. scripts/arm64 bits compiles it for x86 and for ARM, with and without what may differ.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <span>
#include <vector>

#include "estimation/motion_only.hpp"

namespace twofold {
namespace {

/// Numbers in [0, 1) that every machine draws alike.
class Draws {
 public:
  double next() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 40) / static_cast<double>(1 << 24);
  }

 private:
  std::uint64_t state_ = 1;
};

/// In sixteenths of a pixel, whatever the arithmetic before.
float rounded(double px) {
  return static_cast<float>(static_cast<double>(std::lround(16 * px)) / 16);
}

std::vector<MotionObservation> measurements(const Rig& rig, Draws& draws) {
  std::vector<MotionObservation> seen;
  for (int i = 0; i < 200; ++i) {
    double n[6];
    for (double& value : n) value = draws.next();
    const Vector3 x_ref(4 * n[0] - 2, 3 * n[1] - 1.5, 2 + 6 * n[2]);
    const double f = rig.camera.fx, u = rig.camera.cx + f * x_ref.x() / x_ref.z();
    const double v = rig.camera.cy + f * x_ref.y() / x_ref.z();
    seen.push_back(observe_point(
        rig, x_ref, {rounded(u + f * rig.baseline / x_ref.z() + n[3]), rounded(v + n[4]), rounded(u + n[5])},
        0));
  }
  return seen;
}

void mix(std::span<const double> values, std::uint64_t& hash) {
  for (const std::byte byte : std::as_bytes(values))
    hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 1099511628211ULL;
}

void run() {
  Rig rig;
  rig.kind = SensorKind::kStereo;
  rig.camera = {400, 400, 319.5, 239.5, 640, 480};
  rig.baseline = 0.1;
  rig.noise.sigma_px = 1;
  Draws draws;
  std::uint64_t hash = 1469598103934665603ULL;
  double sum = 0;
  SE3 T_c_ref;
  for (int frame = 0; frame < 200; ++frame) {
    std::vector<MotionObservation> seen = measurements(rig, draws);
    const MotionOnlyResult result = optimise_motion(rig, seen, T_c_ref, {});
    T_c_ref = result.T_c_ref;
    mix({T_c_ref.so3().quaternion().coeffs().data(), 4}, hash);
    mix({T_c_ref.translation().data(), 3}, hash);
    mix({result.information.data(), 36}, hash);
    sum += T_c_ref.log().norm() + result.chi2;
  }
  std::printf("%016llx  %.17g\n", static_cast<unsigned long long>(hash), sum);
}

}  // namespace
}  // namespace twofold

int main() {
  twofold::run();
}
