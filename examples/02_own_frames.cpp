// Frames of your own, with OpenCV and Eigen: a rectified stereo recording of EuRoC layout, read by hand.
//   02_own_frames RECORDING fx fy cx cy baseline
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

#include <twofold/eigen.hpp>
#include <twofold/opencv.hpp>
#include <twofold/slam.hpp>

namespace {

/// Lines "time stamp [ns],file name".
bool next_line(std::ifstream& lines, std::int64_t& t_ns, std::string& file) {
  std::string line;
  while (std::getline(lines, line)) {
    if (line.empty() || line.front() == '#') continue;
    const std::size_t comma = line.find(',');
    t_ns = std::stoll(line);
    file = line.substr(comma + 1, line.find_last_not_of("\r") - comma);
    return true;
  }
  return false;
}

cv::Mat read_image(const std::string& file) {
  cv::Mat image = cv::imread(file, cv::IMREAD_GRAYSCALE);
  if (image.empty()) throw std::runtime_error(file + ": not an image");
  return image;
}

int run(const std::string& recording, twofold::CameraRig rig) {
  std::ifstream lines(recording + "/mav0/cam0/data.csv");
  std::int64_t t_ns = 0;
  std::string file;
  if (!next_line(lines, t_ns, file)) throw std::runtime_error(recording + ": no frames");
  const cv::Mat first = read_image(recording + "/mav0/cam0/data/" + file);
  rig.width = first.cols;
  rig.height = first.rows;

  twofold::Slam slam(rig, {.mode = twofold::RunMode::kDeterministic});
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  double path = 0;
  do {
    const cv::Mat left = read_image(recording + "/mav0/cam0/data/" + file);
    const cv::Mat right = read_image(recording + "/mav0/cam1/data/" + file);
    if (const auto pushed = slam.push(twofold::stereo_frame(t_ns, left, right)); !pushed)
      throw std::runtime_error(pushed.reason);
    const auto pose = slam.latest();
    if (!pose || pose->state != twofold::TrackingState::kTracked) continue;
    const Eigen::Vector3d now = twofold::to_eigen(pose->T_world_camera).translation();
    const double deviation = std::sqrt(twofold::covariance(*pose).topLeftCorner<3, 3>().trace());
    std::printf("%.3f %.3f %.3f  +- %.4f m\n", now.x(), now.y(), now.z(), deviation);
    path += (now - last).norm();
    last = now;
  } while (next_line(lines, t_ns, file));
  std::printf("path %.3f m\n", path);
  return path > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 7) throw std::runtime_error("02_own_frames RECORDING fx fy cx cy baseline");
  twofold::CameraRig rig;
  rig.fx = std::atof(argv[2]);
  rig.fy = std::atof(argv[3]);
  rig.cx = std::atof(argv[4]);
  rig.cy = std::atof(argv[5]);
  rig.baseline = std::atof(argv[6]);
  return run(argv[1], rig);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
