#pragma once

#include "camera/calibration.hpp"

namespace twofold {

/// The stereo head of the EuRoC sequences; T_right_left from its T_BS matrices.
inline Calibration euroc() {
  Calibration c;
  c.kind = SensorKind::kStereo;
  c.left = {{458.654, 457.296, 367.215, 248.375, 752, 480},
            {DistortionModel::kRadTan, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}}};
  c.right = {{457.587, 456.134, 379.999, 255.238, 752, 480},
             {DistortionModel::kRadTan, {-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05, 0}}};
  Matrix3 R_b_l, R_b_r;
  R_b_l << 0.0148655429818, -0.999880929698, 0.00414029679422, 0.999557249008, 0.0149672133247,
      0.025715529948, -0.0257744366974, 0.00375618835797, 0.999660727178;
  R_b_r << 0.0125552670891, -0.999755099723, 0.0182237714554, 0.999598781151, 0.0130119051815,
      0.0251588363115, -0.0253898008918, 0.0179005838253, 0.999517347078;
  const SE3 T_b_l(R_b_l, Vector3(-0.0216401454975, -0.064676986768, 0.00981073058949));
  const SE3 T_b_r(R_b_r, Vector3(-0.0198435579556, 0.0453689425024, 0.00786212447038));
  c.T_right_left = T_b_r.inverse() * T_b_l;
  return c;
}

/// A fisheye pair that squints, with different focal lengths and sizes.
inline Calibration fisheye() {
  Calibration c;
  c.left = {{300, 301, 330, 250, 660, 500},
            {DistortionModel::kEquidistant, {-0.009, 0.012, -0.012, 0.004, 0}}};
  c.right = {{310, 309, 310, 235, 640, 480},
             {DistortionModel::kEquidistant, {-0.007, 0.010, -0.010, 0.003, 0}}};
  c.T_right_left = SE3(SO3::exp({0.03, -0.05, 0.02}), {-0.2, 0.01, 0.015});
  return c;
}

inline Calibration double_sphere() {
  Calibration c = fisheye();
  c.left.distortion = {DistortionModel::kDoubleSphere, {-0.2, 0.55}};
  c.right.distortion = {DistortionModel::kDoubleSphere, {-0.18, 0.56}};
  return c;
}

/// A wide pair whose maker calibrates with the rational model.
inline Calibration rational() {
  Calibration c = euroc();
  c.left = {
      {570.2, 569.8, 641.5, 395.1, 1280, 800},
      {DistortionModel::kRational, {0.4371, -2.5066, 0.0006, -0.0002, 1.4637, 0.3137, -2.3387, 1.3903}}};
  c.right = {
      {571.1, 570.4, 636.2, 402.7, 1280, 800},
      {DistortionModel::kRational, {0.4402, -2.5101, -0.0003, 0.0004, 1.4661, 0.3171, -2.3417, 1.3926}}};
  return c;
}

}  // namespace twofold
