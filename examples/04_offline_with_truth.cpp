// A recording, tracked the same way every time, and how far from the truth it came out.
//   04_offline_with_truth [SOURCE [TRAJECTORY]]
#include <cstdio>
#include <exception>
#include <string>

#include <twofold/evaluation.hpp>
#include <twofold/slam.hpp>
#include <twofold/source.hpp>

namespace {

int run(const std::string& name, const char* file) {
  twofold::Source source(name);
  twofold::Slam slam(source.rig(), {.mode = twofold::RunMode::kDeterministic});
  twofold::FrameView frame;
  while (source.next(frame)) slam.push(frame);

  const std::vector<twofold::StampedPose> trajectory = slam.finish().trajectory();  // of the largest map part
  if (file != nullptr) twofold::save_trajectory(file, trajectory);

  const twofold::TrajectoryError error = twofold::compare(trajectory, source.ground_truth());
  std::printf("%zu poses over %.2f m: ATE %.4f m rmse, %.4f m at most, %.4f rad\n", error.pairs,
              error.path_length, error.ate_rmse, error.ate_max, error.rotation_rmse);
  return 0;
}

}  // namespace

int main(int argc, char** argv) try {
  return run(argc > 1 ? argv[1] : "synthetic:courtyard?frames=90", argc > 2 ? argv[2] : nullptr);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
