// Figure 4.3: accuracy of the end pose by covariance propagation alone  (thesis 4.3).
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "experiments/plot.hpp"
#include "experiments/why_filter/experiments.hpp"
#include "experiments/why_filter/settings.hpp"

namespace twofold::bench {
namespace {

/// Covariance of the last of M poses on a sideways metre, N regular points on a plane at 3 m  (eq. 4.3, 4.4).
Matrix6 end_covariance(int frames, int columns, int rows) {
  const Rig rig = why_rig(SensorKind::kStereo);
  std::vector<SE3> poses;
  for (int i = 0; i <= frames; ++i)
    poses.emplace_back(SO3(), Vector3(-static_cast<double>(i) / frames, 0, 0));
  MatrixX H = MatrixX::Zero(6 * frames, 6 * frames);
  for (int c = 0; c < columns; ++c) {
    for (int r = 0; r < rows; ++r) {  // the plane is seen in full from every pose
      const Vector3 x(-0.75 + 2.5 * c / (columns - 1), -1.3 + 2.6 * r / (rows - 1), 3);
      Matrix3 V = Matrix3::Zero();
      std::vector<Matrix63> W;
      for (int i = 0; i <= frames; ++i) {
        const Vector3 x_c = poses[static_cast<std::size_t>(i)] * x;
        const Matrix3 J = rig.project_jacobian(x_c);
        V += 4 * J.transpose() * J;  // sigma = 1/2 px
        if (i == 0) continue;        // T_0 defines the frame
        Matrix36 J_T;
        J_T << J, -J * hat(x_c);
        H.block<6, 6>(6 * (i - 1), 6 * (i - 1)) += 4 * J_T.transpose() * J_T;
        W.emplace_back(4 * J_T.transpose() * J);
      }
      const Matrix3 V_inv = V.inverse();
      for (int a = 0; a < frames; ++a) {
        const Matrix63 WV = W[static_cast<std::size_t>(a)] * V_inv;
        for (int b = 0; b < frames; ++b) {
          H.block<6, 6>(6 * a, 6 * b) -= WV * W[static_cast<std::size_t>(b)].transpose();
        }
      }
    }
  }
  MatrixX unit = MatrixX::Zero(6 * frames, 6);
  unit.bottomRows<6>().setIdentity();
  return H.llt().solve(unit).bottomRows<6>();
}

double log2_det(const Matrix3& S) {
  return std::log2(S.determinant());
}

}  // namespace

void preliminary_experiment(const WhyFilterOptions&, Report& report) {
  const std::vector<int> frames = {1, 2, 4, 8, 16, 32};
  const std::vector<std::pair<int, int>> grids = {
      {4, 3}, {7, 5}, {13, 9}, {25, 17}};  // each contains the one before
  std::vector<std::vector<Matrix6>> Sigma(frames.size());
  for (std::size_t m = 0; m < frames.size(); ++m) {
    for (const auto& [c, r] : grids) Sigma[m].push_back(end_covariance(frames[m], c, r));
  }
  std::vector<std::vector<double>> rows;
  int cells = 0, kept = 0;
  double closest = 1e300;
  for (const bool rotation : {false, true}) {
    const auto part = [&](const Matrix6& S) -> Matrix3 {
      return rotation ? S.bottomRightCorner<3, 3>() : S.topLeftCorner<3, 3>();
    };
    const auto E = [&](std::size_t m, std::size_t n) {  // eq. 4.10
      return 0.5 * (log2_det(part(Sigma[0][0])) - log2_det(part(Sigma[m][n])));
    };
    std::vector<Series> series;
    for (std::size_t m = 0; m < frames.size(); ++m) {
      Series s{.name = "M = " + std::to_string(frames[m]), .markers = true};
      for (std::size_t n = 0; n < grids.size(); ++n) {
        s.x.push_back(grids[n].first * grids[n].second);
        s.y.push_back(E(m, n));
        rows.push_back(
            {static_cast<double>(rotation), static_cast<double>(frames[m]), s.x.back(), s.y.back()});
        if (m + 1 == frames.size() || n + 1 == grids.size()) continue;
        const double points = s.x.back();
        const double doublings = std::log2(grids[n + 1].first * grids[n + 1].second / points);
        const double by_points = (E(m, n + 1) - E(m, n)) / doublings, by_frames = E(m + 1, n) - E(m, n);
        ++cells;
        kept += by_points > by_frames;
        closest = std::min(closest, by_points - by_frames);
      }
      series.push_back(s);
    }
    PlotOptions plot{.title = rotation ? "fig. 4.3: rotation" : "fig. 4.3: translation",
                     .x_label = "points N",
                     .y_label = "entropy reduction [bit]"};
    plot.log_x = true;
    write_png(report.file(rotation ? "fig4_3_rotation.png" : "fig4_3_translation.png"),
              draw_plot(series, plot));
  }
  report.csv("fig4_3.csv", {"rotation", "M", "N", "entropy_bit"}, rows);
  report.state("thesis fig. 4.3",
               "covariance propagation: doubling N gains more than doubling M in every cell",
               text("%d of %d cells; least advantage %.2f bit", kept, cells, closest), kept == cells);
}

}  // namespace twofold::bench
