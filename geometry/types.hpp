#pragma once

#include <Eigen/Core>

namespace twofold {

using Vector2 = Eigen::Vector2d;
using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix3 = Eigen::Matrix3d;
using Matrix4 = Eigen::Matrix4d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Matrix36 = Eigen::Matrix<double, 3, 6>;

}  // namespace twofold
