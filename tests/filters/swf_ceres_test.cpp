// Batch equality: the filter with an unlimited window against Ceres on the same cost.
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <map>

#include "swf_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

using PoseBlock = std::array<double, 6>;  // rotation vector, translation of T_c_w

SE3 to_se3(const double* block) {
  return {SO3::exp(Vector3(block[0], block[1], block[2])), Vector3(block[3], block[4], block[5])};
}

PoseBlock to_block(const SE3& T) {
  const Vector3 w = T.so3().log();
  return {w.x(), w.y(), w.z(), T.translation().x(), T.translation().y(), T.translation().z()};
}

struct Reprojection {
  const Rig& rig;
  StereoPixel pixel;
  double sigma;
  template <class T>
  bool operator()(const T* pose, const T* point, T* r) const {
    T x[3];
    ceres::AngleAxisRotatePoint(pose, point, x);
    for (int i = 0; i < 3; ++i) x[i] += pose[3 + i];
    r[0] = (pixel.x() - (rig.camera.fx * x[0] / x[2] + rig.camera.cx)) / sigma;
    r[1] = (pixel.y() - (rig.camera.fy * x[1] / x[2] + rig.camera.cy)) / sigma;
    r[2] = (pixel.z() - (rig.camera.fx * (x[0] - rig.baseline) / x[2] + rig.camera.cx)) / sigma;
    return true;
  }
};

struct Motion {
  MotionInput input;
  bool operator()(const double* prev, const double* cur, double* r) const {
    const Matrix6 S = Matrix6(input.covariance.inverse()).llt().matrixU();
    Eigen::Map<Vector6> residual(r);
    residual = S * (to_se3(cur) * to_se3(prev).inverse() * input.T_cur_prev.inverse()).log();
    return true;
  }
};

struct FirstPose {
  Matrix6 information;
  bool operator()(const double* pose, double* r) const {
    Eigen::Map<Vector6> residual(r);
    residual = Matrix6(information.llt().matrixU()) * to_se3(pose).log();
    return true;
  }
};

TEST(SwfCeres, UnlimitedWindowIsTheBatchSolution) {
  const SwfScene scene = make_swf_scene({.frames = 8, .points = 40, .seed = 3});
  SlidingWindowFilter filter(scene.rig, exact_options(0));
  filter.set_first_pose(SE3(), swf_first_information());
  for (const FilterFrame& frame : scene.frames) filter.step(frame);

  std::vector<PoseBlock> poses;
  for (const SE3& T : scene.T_c_w) poses.push_back(to_block(T));
  std::vector<Vector3> points = scene.points;
  ceres::Problem problem;
  problem.AddResidualBlock(new ceres::NumericDiffCostFunction<FirstPose, ceres::RIDDERS, 6, 6>(
                               new FirstPose{swf_first_information()}),
                           nullptr, poses[0].data());
  for (std::size_t j = 0; j < poses.size(); ++j) {
    if (scene.frames[j].motion) {
      problem.AddResidualBlock(new ceres::NumericDiffCostFunction<Motion, ceres::RIDDERS, 6, 6, 6>(
                                   new Motion{*scene.frames[j].motion}),
                               nullptr, poses[j - 1].data(), poses[j].data());
    }
    for (const auto& o : scene.frames[j].observations) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Reprojection, 3, 6, 3>(new Reprojection{scene.rig, o.pixel, 0.5}),
          nullptr, poses[j].data(), points[static_cast<std::size_t>(o.landmark)].data());
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 100;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-16;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);

  double worst_pose = 0, worst_point = 0;
  for (std::size_t j = 0; j < poses.size(); ++j) {
    const SE3 difference = filter.T_c_w(static_cast<int>(j)) * to_se3(poses[j].data()).inverse();
    worst_pose = std::max(worst_pose, difference.log().norm());
  }
  for (int l = 0; l < filter.landmark_count(); ++l) {
    const auto id = static_cast<std::size_t>(filter.landmark_id(l));
    worst_point = std::max(worst_point, (filter.landmark(l) - points[id]).norm());
  }
  RecordProperty("worst_pose", std::to_string(worst_pose));
  EXPECT_LT(worst_pose, 1e-6);
  EXPECT_LT(worst_point, 1e-6);
  std::printf("batch against Ceres: poses %.2e, landmarks %.2e\n", worst_pose, worst_point);
}

}  // namespace
}  // namespace twofold
