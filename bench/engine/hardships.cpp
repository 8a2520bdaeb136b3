#include "bench/engine/hardships.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "synthetic/image_effects.hpp"
#include "synthetic/random.hpp"

namespace twofold {
namespace {

template <class Change>
void change_images(Frame& frame, const Change& change) {
  for (cv::Mat* image : {&frame.left, &frame.right}) {
    if (!image->empty()) *image = change(*image);
  }
}

/// In [0, 1), another one for each frame and each `what`.
double chance(const Frame& frame, std::uint64_t what) {
  const std::uint64_t word =
      synthetic::mix64(synthetic::mix64(what) ^ static_cast<std::uint64_t>(frame.index));
  return synthetic::unit_interval(word);
}

cv::Mat looked_up(const cv::Mat& image, double gain, double gamma) {
  cv::Mat table(1, 256, CV_8UC1), out;
  for (int i = 0; i < 256; ++i)
    table.at<std::uint8_t>(i) = cv::saturate_cast<std::uint8_t>(255 * gain * std::pow(i / 255.0, gamma));
  cv::LUT(image, table, out);
  return out;
}

cv::Mat exposed(const cv::Mat& image, double gain, double noise, std::uint64_t stream) {
  cv::Mat intensity;
  image.convertTo(intensity, CV_32FC1);
  return synthetic::expose(intensity, gain, noise, {23, stream});
}

bool blur(Frame& frame, double /*t*/) {
  change_images(frame, [](const cv::Mat& image) {
    cv::Mat out;
    cv::blur(image, out, {9, 1});
    return out;
  });
  return true;
}

bool blur_now_and_then(Frame& frame, double t) {
  return std::fmod(t, 1.0) < 0.25 ? blur(frame, t) : true;
}

bool compress(Frame& frame, double /*t*/) {
  change_images(frame, [](const cv::Mat& image) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 20});
    return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  });
  return true;
}

bool bend_tones(Frame& frame, double t) {
  const double gamma = std::exp2(std::sin(2 * std::numbers::pi * t / 5));
  change_images(frame, [&](const cv::Mat& image) { return looked_up(image, 1, gamma); });
  return true;
}

bool step_exposure(Frame& frame, double t) {
  const double gain = std::fmod(t, 2.0) < 1 ? 1 : 0.4;
  change_images(frame, [&](const cv::Mat& image) { return looked_up(image, gain, 1); });
  return true;
}

bool overexpose(Frame& frame, double /*t*/) {
  change_images(frame, [](const cv::Mat& image) { return looked_up(image, 2.2, 1); });
  return true;
}

bool darken(Frame& frame, double /*t*/) {
  auto stream = static_cast<std::uint64_t>(2 * frame.index);  // another one for each image
  change_images(frame, [&](const cv::Mat& image) { return exposed(image, 0.25, 3, stream++); });
  return true;
}

bool darken_right(Frame& frame, double /*t*/) {
  if (!frame.right.empty()) frame.right = looked_up(frame.right, 0.6, 1);
  return true;
}

bool shade_corners(Frame& frame, double /*t*/) {
  change_images(frame, [](const cv::Mat& image) {
    cv::Mat out(image.size(), CV_8UC1);
    const double cx = 0.5 * image.cols, cy = 0.5 * image.rows, corner = cx * cx + cy * cy;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const double r2 = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / corner;
        out.at<std::uint8_t>(y, x) =
            cv::saturate_cast<std::uint8_t>(image.at<std::uint8_t>(y, x) * (1 - 0.7 * r2));
      }
    }
    return out;
  });
  return true;
}

bool kill_pixels(Frame& frame, double /*t*/) {
  std::uint64_t camera = 0;
  change_images(frame, [&](const cv::Mat& image) {
    cv::Mat out = image.clone();
    const std::uint64_t key = synthetic::mix64(++camera);
    const auto pixels = static_cast<std::uint64_t>(out.total());
    for (std::uint64_t i = 0; i < pixels / 200; ++i) {
      const std::uint64_t word = synthetic::mix64(key + i);
      out.ptr<std::uint8_t>()[word % pixels] = (word >> 40) % 2 == 0 ? 0 : 255;
    }
    return out;
  });
  return true;
}

/// A finger or mud on the lens.
bool soil(Frame& frame, double /*t*/) {
  change_images(frame, [](const cv::Mat& image) {
    cv::Mat out = image.clone();
    const cv::Rect where(0, out.rows / 2, out.cols / 3, out.rows / 2);
    out(where).setTo(60);
    return out;
  });
  return true;
}

bool drop_a_fifth(Frame& frame, double /*t*/) {
  return chance(frame, 1) >= 0.2;
}

bool drop_bursts(Frame& /*frame*/, double t) {
  return std::fmod(t, 1.0) < 0.75;
}

bool cover(Frame& frame, double t) {
  if (t < 2 || t >= 2.7) return true;
  change_images(frame, [](const cv::Mat& image) { return cv::Mat::zeros(image.size(), CV_8UC1); });
  frame.depth.setTo(0);
  return true;
}

bool jitter_clock(Frame& frame, double /*t*/) {
  frame.t_ns += static_cast<std::int64_t>(1e6 * 8 * (chance(frame, 2) - 0.5));
  return true;
}

bool lose_depth(Frame& frame, double /*t*/) {
  if (frame.depth.empty()) return true;
  const cv::Size cells(frame.depth.cols / 16 + 1, frame.depth.rows / 16 + 1);
  for (int y = 0; y < cells.height; ++y) {
    for (int x = 0; x < cells.width; ++x) {
      if (chance(frame, 16 + static_cast<std::uint64_t>(y * cells.width + x)) < 0.4) continue;
      const cv::Rect cell(16 * x, 16 * y, 16, 16);
      frame.depth(cell & cv::Rect({}, frame.depth.size())).setTo(0);
    }
  }
  return true;
}

bool slip_rows(Frame& frame, double /*t*/) {
  if (frame.right.empty()) return true;
  const cv::Matx23d shift(1, 0, 0, 0, 1, 0.7);
  cv::warpAffine(frame.right.clone(), frame.right, shift, frame.right.size(), cv::INTER_LINEAR,
                 cv::BORDER_REPLICATE);
  return true;
}

/// A round lens before a larger sensor, or what undistorting leaves: black outside of a circle.
bool mask_circle(Frame& frame, double /*t*/) {
  change_images(frame, [](const cv::Mat& image) {
    cv::Mat mask = cv::Mat::zeros(image.size(), CV_8UC1), out = mask.clone();
    const int radius = static_cast<int>(0.58 * std::min(image.cols, image.rows));
    cv::circle(mask, {image.cols / 2, image.rows / 2}, radius, 255, cv::FILLED, cv::LINE_AA);
    cv::multiply(image, mask, out, 1.0 / 255);
    return out;
  });
  return true;
}

/// What moves with the camera, a bonnet or a robot's own body: spots in the lower fifth of the image, so near
/// that a pair sees them a twelfth of its width apart and a depth camera measures nothing.
bool show_bonnet(Frame& frame, double /*t*/) {
  int shift = 0;  // of the image, to the left
  change_images(frame, [&](const cv::Mat& image) {
    cv::Mat out = image.clone();
    const int top = out.rows * 4 / 5, width = 2 * out.cols;
    cv::Mat spots(out.rows - top, width, CV_32FC1), bonnet;
    for (int y = 0; y < spots.rows; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto key = static_cast<std::uint64_t>(y * width + x);
        spots.at<float>(y, x) =
            static_cast<float>(110 + 500 * (synthetic::unit_interval(synthetic::mix64(key)) - 0.5));
      }
    }
    cv::GaussianBlur(spots, spots, {}, 3);
    spots(cv::Rect(shift, 0, out.cols, spots.rows)).convertTo(bonnet, CV_8UC1);
    bonnet.copyTo(out.rowRange(top, out.rows));
    shift += out.cols / 12;
    return out;
  });
  if (!frame.depth.empty()) frame.depth.rowRange(frame.depth.rows * 4 / 5, frame.depth.rows).setTo(0);
  return true;
}

/// The time, written into each image by the recorder.
bool write_caption(Frame& frame, double t) {
  change_images(frame, [&](const cv::Mat& image) {
    cv::Mat out = image.clone();
    const auto text = "CAM 1  2024-05-01  10:00:" + std::to_string(10 + static_cast<int>(t) % 50);
    const double scale = image.cols / 640.0;
    cv::putText(out, text, {static_cast<int>(24 * scale), static_cast<int>(40 * scale)},
                cv::FONT_HERSHEY_SIMPLEX, scale, 255, 2);
    return out;
  });
  return true;
}

bool nothing(Frame& /*frame*/, double /*t*/) {
  return true;
}

}  // namespace

const std::vector<Hardship>& hardships() {
  static const std::vector<Hardship> kAll = {
      {"as it is", nothing},
      {"blurred over 9 px", blur},
      {"blurred for a quarter of each second", blur_now_and_then},
      {"JPEG of quality 20", compress},
      {"gamma from 0.5 to 2 and back in 5 s", bend_tones},
      {"exposure down to 0.4 each other second", step_exposure},
      {"gain 2.2: bright parts are white", overexpose},
      {"gain 0.25, noise 3", darken},
      {"the right image at a gain of 0.6", darken_right},
      {"corners at 30 % of their light", shade_corners},
      {"1 pixel in 200 dead", kill_pixels},
      {"a sixth of the lens covered", soil},
      {"a fifth of the frames missing", drop_a_fifth},
      {"a quarter of each second missing", drop_bursts},
      {"black for 0.7 s", cover},
      {"time stamps off by 4 ms at most", jitter_clock},
      {"60 % of the depth missing", lose_depth},
      {"right image 0.7 rows too low", slip_rows},
      {"focal length 2 % too long", nothing, [](Rig& rig) { rig.camera.fx *= 1.02, rig.camera.fy *= 1.02; }},
      {"principal point off by 6 px", nothing, [](Rig& rig) { rig.camera.cx += 6, rig.camera.cy -= 6; }},
      {"black outside of a circle", mask_circle},
      {"a bonnet in the lower fifth", show_bonnet},
      {"the time written into the image", write_caption},
  };
  return kAll;
}

}  // namespace twofold
