#pragma once

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "calibration/board.hpp"
#include "camera/calibration.hpp"

namespace twofold::testing {

/// Sees a printed board through a distorting camera: a ray through each of 4x4 points of every pixel, by this
/// project's own lens model (OpenCV's is in the code under test).
class BoardCamera {
 public:
  explicit BoardCamera(const CameraModel& model) : model_(model), rays_(rays_of(model)) {}

  /// @param print  CV_8UC1: the board as printed
  /// @param px_per_m  of the print; corner 0 of the board is at `origin_px` of it, edges counted from the
  ///                  corner of its first pixel
  [[nodiscard]] cv::Mat see(const cv::Mat& print, double px_per_m, cv::Point2d origin_px, const SE3& T_c_b,
                            std::mt19937& random) const {
    const Matrix3 R_b_c = T_c_b.rotation().transpose();
    const Vector3 eye_b = T_c_b.inverse().translation();
    const int width = model_.pinhole.width, height = model_.pinhole.height;
    cv::Mat sums(height, width, CV_32F, cv::Scalar(0));
    std::size_t n = 0;
    for (int y = 0; y < kSub * height; ++y) {
      float* row = sums.ptr<float>(y / kSub);
      for (int x = 0; x < kSub * width; ++x) {
        const Vector3 d = R_b_c * rays_[n++];
        const double s = -eye_b.z() / d.z();
        const double u = (eye_b.x() + s * d.x()) * px_per_m + origin_px.x;
        const double v = (eye_b.y() + s * d.y()) * px_per_m + origin_px.y;
        const bool on_print = s > 0 && u >= 0 && v >= 0 && u < print.cols && v < print.rows;
        row[x / kSub] +=
            on_print ? print.at<unsigned char>(static_cast<int>(v), static_cast<int>(u)) : 110.0F;
      }
    }
    cv::Mat image;
    sums /= kSub * kSub;
    cv::GaussianBlur(sums, sums, {3, 3}, 0.5);
    std::normal_distribution<float> noise(0, 2);
    for (int i = 0; i < width * height; ++i)
      sums.ptr<float>()[i] = 20 + 0.82F * sums.ptr<float>()[i] + noise(random);
    sums.convertTo(image, CV_8U);
    return image;
  }

 private:
  static constexpr int kSub = 4;

  static std::vector<Vector3> rays_of(const CameraModel& model) {
    std::vector<Vector3> rays;
    for (int y = 0; y < kSub * model.pinhole.height; ++y) {
      for (int x = 0; x < kSub * model.pinhole.width; ++x) {
        const Vector2 uv((x + 0.5) / kSub - 0.5, (y + 0.5) / kSub - 0.5);
        rays.push_back(model.unproject(uv).value_or(Vector3(0, 0, 1)));
      }
    }
    return rays;
  }

  CameraModel model_;
  std::vector<Vector3> rays_;
};

/// A chessboard as printed, with a white rim of one square; 40 px a square.
inline constexpr int kPrintSquarePx = 40;
inline cv::Mat print_chessboard(const Board& board) {
  cv::Mat print((board.rows + 3) * kPrintSquarePx, (board.columns + 3) * kPrintSquarePx, CV_8UC1,
                cv::Scalar(255));
  for (int row = 0; row <= board.rows; ++row) {
    for (int column = 0; column <= board.columns; ++column) {
      if ((row + column) % 2 != 0) continue;
      print(cv::Rect((column + 1) * kPrintSquarePx, (row + 1) * kPrintSquarePx, kPrintSquarePx,
                     kPrintSquarePx)) = 0;
    }
  }
  return print;
}

inline CameraModel test_camera(double f, double cx, double cy, double k1, double k2, double p1, double p2) {
  CameraModel model;
  model.pinhole = {f, 1.004 * f, cx, cy, 640, 480};
  model.distortion.model = DistortionModel::kRadTan;
  model.distortion.coefficients = {k1, k2, p1, p2, 0};
  return model;
}

/// Whether all of the board and a quarter of a square around it is seen.
inline bool sees(const CameraModel& camera, const Board& board, const SE3& T_c_b) {
  for (const double x : {-1.25, board.corners_a_row() + 0.25}) {
    for (const double y : {-1.25, board.corner_rows() + 0.25}) {
      const Vector3 x_c = T_c_b * Vector3(x * board.square, y * board.square, 0);
      if (x_c.z() < 0.05) return false;
      const Vector2 uv = camera.project(x_c);
      if (uv.x() < 3 || uv.y() < 3 || uv.x() > 636 || uv.y() > 476) return false;
    }
  }
  return true;
}

/// Poses of the board in the camera: somewhere in the image, tilted by up to max_tilt [rad] in any direction.
inline SE3 random_pose(const Board& board, double max_tilt, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  const double width = board.corners_a_row() * board.square;
  const double z = width * (1.3 + 0.6 * unit(random));
  const Vector3 centre_b(0.5 * width, 0.5 * board.corner_rows() * board.square, 0);
  const Vector3 centre_c(0.55 * z * unit(random), 0.42 * z * unit(random), z);
  const SO3 R = SO3::exp(Vector3(0, 0, 0.3 * unit(random))) *
                SO3::exp(max_tilt * Vector3(unit(random), unit(random), 0));
  return SE3(R, centre_c - R.matrix() * centre_b);
}

}  // namespace twofold::testing
