// Window 1 against a textbook iterated extended Kalman filter in covariance form.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <map>

#include "geometry/cbh.hpp"
#include "swf_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

/// EKF-SLAM with iterated update  (Bar-Shalom; Bell & Cathey 1993). State: pose, then landmarks in the order
/// met.
class IteratedEkf {
 public:
  IteratedEkf(const Rig& rig, const Matrix6& information) : rig_(rig), P_(information.inverse()) {}

  void step(const FilterFrame& frame, bool first) {
    if (!first) predict(*frame.motion);
    std::vector<LandmarkObservation> known, fresh;
    for (const auto& o : frame.observations) (index_.count(o.landmark) ? known : fresh).push_back(o);
    if (!known.empty()) update(known);
    for (const auto& o : fresh) augment(o);
  }

  SE3 T;
  std::vector<Vector3> landmarks;
  const MatrixX& covariance() const { return P_; }
  int index_of(std::int64_t id) const { return index_.at(id); }

 private:
  void predict(const MotionInput& input) {
    T = input.T_cur_prev * T;
    MatrixX F = MatrixX::Identity(P_.rows(), P_.cols());
    F.topLeftCorner<6, 6>() = input.T_cur_prev.adjoint();
    P_ = (F * P_ * F.transpose()).eval();
    P_.topLeftCorner<6, 6>() += input.covariance;
  }

  void update(const std::vector<LandmarkObservation>& known) {
    const SE3 T0 = T;
    const std::vector<Vector3> landmarks0 = landmarks;
    const auto rows = 3 * static_cast<Eigen::Index>(known.size());
    VectorX xi = VectorX::Zero(P_.rows());
    MatrixX K, H;
    for (int iteration = 0; iteration < 40; ++iteration) {
      const Matrix6 J_l = cbh_jacobian<SE3>(xi.head<6>(), CbhOrder::kExact).inverse();
      H = MatrixX::Zero(rows, P_.rows());
      VectorX innovation(rows);
      MatrixX R = MatrixX::Zero(rows, rows);
      for (std::size_t i = 0; i < known.size(); ++i) {
        const int l = index_.at(known[i].landmark);
        const Vector3 x_c = T * landmarks[static_cast<std::size_t>(l)];
        const Matrix3 J = rig_.project_jacobian(x_c);
        const auto row = 3 * static_cast<Eigen::Index>(i);
        Matrix36 J_T;
        J_T << J, -J * hat(x_c);
        H.block<3, 6>(row, 0) = J_T * J_l;
        H.block<3, 3>(row, 6 + 3 * l) = J * T.rotation();
        innovation.segment<3>(row) = known[i].pixel - rig_.project(x_c);
        R.block<3, 3>(row, row) = known[i].information.inverse();
      }
      K = P_ * H.transpose() * (H * P_ * H.transpose() + R).inverse();
      xi = K * (innovation + H * xi);
      T = SE3::exp(xi.head<6>()) * T0;
      for (std::size_t l = 0; l < landmarks.size(); ++l) {
        landmarks[l] = landmarks0[l] + xi.segment<3>(6 + 3 * static_cast<Eigen::Index>(l));
      }
    }
    P_ = ((MatrixX::Identity(P_.rows(), P_.rows()) - K * H) * P_).eval();
    // The estimate moved: covariance in the tangent space at the new pose.
    MatrixX G = MatrixX::Identity(P_.rows(), P_.rows());
    G.topLeftCorner<6, 6>() = cbh_jacobian<SE3>(xi.head<6>(), CbhOrder::kExact).inverse();
    P_ = (G * P_ * G.transpose()).eval();
  }

  void augment(const LandmarkObservation& o) {
    const Vector3 x_c = rig_.unproject(o.pixel);
    const Matrix3 R_w_c = T.rotation().transpose();
    Matrix36 G_T;
    G_T << -R_w_c, R_w_c * hat(x_c);
    const Matrix3 G_z = R_w_c * rig_.project_jacobian(x_c).inverse();
    const auto n = P_.rows();
    MatrixX P(n + 3, n + 3);
    P.topLeftCorner(n, n) = P_;
    P.bottomLeftCorner(3, n) = G_T * P_.topRows(6);
    P.topRightCorner(n, 3) = P.bottomLeftCorner(3, n).transpose();
    P.bottomRightCorner<3, 3>() =
        G_T * P_.topLeftCorner<6, 6>() * G_T.transpose() + G_z * o.information.inverse() * G_z.transpose();
    P_ = P;
    index_[o.landmark] = static_cast<int>(landmarks.size());
    landmarks.push_back(T.inverse() * x_c);
  }

  Rig rig_;
  MatrixX P_;
  std::map<std::int64_t, int> index_;
};

TEST(SwfIteratedEkf, WindowOneIsTheIteratedEkf) {
  const SwfScene scene = make_swf_scene({.frames = 8, .points = 30, .seed = 5, .visible = 3.0});
  SlidingWindowFilter filter(scene.rig, exact_options(1));
  filter.set_first_pose(SE3(), swf_first_information());
  IteratedEkf ekf(scene.rig, swf_first_information());
  double worst_pose = 0, worst_point = 0, worst_covariance = 0;
  for (std::size_t j = 0; j < scene.frames.size(); ++j) {
    filter.step(scene.frames[j]);
    ekf.step(scene.frames[j], j == 0);
    worst_pose = std::max(worst_pose, (filter.newest_T_c_w() * ekf.T.inverse()).log().norm());
    const auto covariances = filter.covariances();
    ASSERT_TRUE(covariances);
    const auto relative = [](const MatrixX& a, const MatrixX& b) { return (a - b).norm() / b.norm(); };
    worst_covariance =
        std::max(worst_covariance, relative(covariances->poses[0], ekf.covariance().topLeftCorner<6, 6>()));
    ASSERT_EQ(filter.landmark_count(), static_cast<int>(ekf.landmarks.size()));
    for (int l = 0; l < filter.landmark_count(); ++l) {
      const int e = ekf.index_of(filter.landmark_id(l));
      worst_point =
          std::max(worst_point, (filter.landmark(l) - ekf.landmarks[static_cast<std::size_t>(e)]).norm());
      const MatrixX P = ekf.covariance().block<3, 3>(6 + 3 * e, 6 + 3 * e);
      worst_covariance =
          std::max(worst_covariance, relative(covariances->landmarks[static_cast<std::size_t>(l)], P));
    }
  }
  EXPECT_LT(worst_pose, 1e-8);
  EXPECT_LT(worst_point, 1e-8);
  EXPECT_LT(worst_covariance, 1e-7);
  std::printf("window 1 against iterated EKF: pose %.2e, landmarks %.2e, covariance (relative) %.2e\n",
              worst_pose, worst_point, worst_covariance);
}

}  // namespace
}  // namespace twofold
