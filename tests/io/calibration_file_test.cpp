#include "io/files/calibration_file.hpp"

#include <tuple>

#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

constexpr const char* kStereo = R"(sensor: stereo
fps: 20
cameras:
  - size: [640, 480]
    intrinsics: [500, 501, 320, 240]
    distortion: {model: radtan, coefficients: [-0.2, 0.05, 0.001, 0.002]}
  - {size: [640, 480], intrinsics: [502, 503, 321, 241]}
T_right_left: [1, 0, 0, -0.11,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]
)";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos);
  return text.replace(at, from.size(), to);
}

TEST(CalibrationFile, OwnForm) {
  const ScratchFolder folder;
  const auto c = read_calibration(folder.write("c.yaml", kStereo));
  EXPECT_EQ(c.kind, SensorKind::kStereo);
  EXPECT_EQ(c.left.pinhole.fy, 501);
  EXPECT_EQ(c.left.distortion.model, DistortionModel::kRadTan);
  EXPECT_EQ(c.left.distortion.coefficients[3], 0.002);
  EXPECT_EQ(c.right.pinhole.cx, 321);
  EXPECT_NEAR(c.T_right_left.translation().x(), -0.11, 1e-15);
  EXPECT_EQ(c.fps, 20);
  EXPECT_EQ(c.invalid_reason(), "");
  Calibration far = c;  // of surfaces
  far.depth_min = far.depth_max + 1;
  EXPECT_NE(far.invalid_reason(), "");

  const auto rgbd = read_calibration(folder.write(
      "d.yaml",
      "sensor: rgbd\nreadout: 0.025\ncameras: [{size: [640, 480], intrinsics: [525, 525, 319.5, 239.5]}]\n"
      "depth: {unit: 0.0002, max: 5, virtual_baseline: 0.075}\n"));
  EXPECT_EQ(rgbd.depth_unit, 0.0002);
  EXPECT_EQ(rgbd.depth_max, 5);
  EXPECT_EQ(rgbd.virtual_baseline, 0.075);
  EXPECT_EQ(rgbd.readout, 0.025);
  EXPECT_FALSE(rgbd.depth_apart);
  const auto apart = read_calibration(
      folder.write("apart.yaml",
                   "sensor: rgbd\ncameras: [{size: [640, 480], intrinsics: [525, 525, 319.5, 239.5]}]\n"
                   "depth: {unit: 0.001, size: [320, 240], intrinsics: [290, 291, 160, 120],\n"
                   "        distortion: {model: radtan, coefficients: [0.1, 0, 0, 0]},\n"
                   "        T_left_depth: [1, 0, 0, -0.025,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]}\n"));
  ASSERT_TRUE(apart.depth_apart);
  EXPECT_EQ(apart.invalid_reason(), "");
  EXPECT_EQ(apart.depth_camera.model.pinhole.fy, 291);
  EXPECT_EQ(apart.depth_camera.model.pinhole.height, 240);
  EXPECT_EQ(apart.depth_camera.model.distortion.coefficients[0], 0.1);
  EXPECT_EQ(apart.depth_camera.T_left_depth.translation().x(), -0.025);
}

TEST(CalibrationFile, NamesTheKeyThatIsWrong) {
  const ScratchFolder folder;
  const auto error = [&](const std::string& text) {
    const auto file = folder.write("c.yaml", text);
    return io_error_of([&] { expect_valid(file, read_calibration(file)); });
  };
  const std::pair<std::string, const char*> cases[] = {
      {with(kStereo, "    intrinsics: [500, 501, 320, 240]\n", ""), "key 'cameras[0].intrinsics' is missing"},
      {with(kStereo, "[500,", "[-500,"), "left camera: "},
      {with(kStereo, "[500,", "[.nan,"), "not a finite number"},
      {with(kStereo, "500, 501,", "500,"), "has 3 numbers, 4 are needed"},
      {with(kStereo, "fps: 20", "fsp: 20"), "unknown key 'fsp'"},
      {with(kStereo, "fps: 20", "readout: -0.01"), "readout must be within 0 and"},
      {with(kStereo, "fps: 20", "readout: 23.7"), "readout must be within 0 and"},  // milliseconds
      {with(kStereo, "fps: 20", "fps: 20\nreadout: 0.06"), "longer than a frame takes (0.05"},
      {with(kStereo, "fps: 20", "depth: {min: 0}"), "0 < min < max"},
      {with(kStereo, "320, 240]", "320000, 240]"), "left camera: cx, cy must be in or near the image"},
      {with(kStereo, "[-0.2, 0.05,", "[-5, 0.05,"), "the lens folds the middle of the image over"},
      {with(kStereo, "T_right_left: [1, 0, 0, -0.11,  0, 1, 0, 0,  0, 0, 1,",
            "T_right_left: [-1, 0, 0, 0.11,  0, 1, 0, 0,  0, 0, -1,"),
       "must look the same way"},
      {with(kStereo, "radtan", "fancy"), "'fancy'"},
      {with(kStereo, "T_right_left: [1,", "T_right_left: [2,"), "not a rotation and a translation"},
      {with(kStereo, "stereo", "sonar"), "'sonar'"},
      {with(kStereo, "size: [640, 480]", "size: [0, 480]"), "left camera: "},
      {"a: [", "c.yaml:"},
      {"just text", "not a YAML file of keys"},
      {"other: 1\n", "not a calibration"}};
  for (const auto& [text, part] : cases) {
    const auto message = error(text);
    EXPECT_NE(message.find(part), std::string::npos) << message << "\nfor\n" << text;
    EXPECT_NE(message.find("c.yaml"), std::string::npos) << message;
  }
}

constexpr const char* kEight = "[0.4371, -2.5066, 0.0006, -0.0002, 1.4637, 0.3137, -2.3387, 1.3903]";

std::string one_camera(const std::string& model, const std::string& coefficients) {
  return "sensor: mono\ncameras:\n  - size: [1280, 720]\n    intrinsics: [610, 611, 640, 360]\n"
         "    distortion: {model: " +
         model + ", coefficients: " + coefficients + "}\n";
}

std::string euroc_camera(const std::string& model, const std::string& coefficients) {
  return "sensor_type: camera\ncamera_model: pinhole\nresolution: [1280, 720]\n"
         "intrinsics: [610, 611, 640, 360]\ndistortion_model: " +
         model + "\ndistortion_coefficients: " + coefficients + "\n";
}

/// Whatever the model is called, as OpenCV takes coefficients: eight of them are a quotient unless the last
/// three are zero.
TEST(CalibrationFile, RationalLens) {
  const ScratchFolder folder;
  const auto lens = [&](const std::string& text) {
    return read_calibration(folder.write("c.yaml", text)).left.distortion;
  };
  const Distortion rational = lens(one_camera("rational", kEight));
  EXPECT_EQ(rational.model, DistortionModel::kRational);
  EXPECT_EQ(rational.coefficients,
            (Distortion::Coefficients{0.4371, -2.5066, 0.0006, -0.0002, 1.4637, 0.3137, -2.3387, 1.3903}));
  const std::string zeros = std::string(kEight).replace(std::string(kEight).size() - 1, 1, ", 0, 0, 0, 0]");
  for (const std::string& text : {one_camera("rational_polynomial", kEight), one_camera("radtan", kEight),
                                  one_camera("rational", zeros), euroc_camera("rational_polynomial", kEight),
                                  euroc_camera("radial-tangential", kEight)}) {
    const Distortion distortion = lens(text);
    EXPECT_EQ(distortion.model, DistortionModel::kRational) << text;
    EXPECT_EQ(distortion.coefficients, rational.coefficients) << text;
  }
  const Distortion plain = lens(one_camera("rational", "[0.1, -0.2, 0, 0, 0.05, 0, 0, 0]"));
  EXPECT_EQ(plain.model, DistortionModel::kRadTan);
  EXPECT_EQ(plain.coefficients[4], 0.05);
}

TEST(CalibrationFile, ALensMayBeNone) {
  const ScratchFolder folder;
  const auto file =
      folder.write("c.yaml",
                   "sensor: mono\ncameras:\n  - size: [640, 480]\n    intrinsics: [500, 500, 320, 240]\n"
                   "    distortion: {model: none}\n");
  EXPECT_EQ(read_calibration(file).left.distortion.model, DistortionModel::kNone);
}

TEST(CalibrationFile, SaysWhyALensIsRefused) {
  const ScratchFolder folder;
  const auto error = [&](const std::string& model, const std::string& coefficients) {
    return io_error_of(
        [&] { (void)read_calibration(folder.write("c.yaml", one_camera(model, coefficients))); });
  };
  const std::tuple<const char*, const char*, const char*> cases[] = {
      {"fancy", "[0.1]", "is 'fancy', not none, radtan, rational or equidistant"},
      {"radtan", "[0.1, 0, 0]", "has 3 coefficients, not 4, 5, 8, 12 or 14"},
      {"rational", "[0.1, 0, 0, 0, 0]", "has 5 coefficients, rational has 8"},
      {"rational", "[0.1, 0, 0, 0, 0, 0.1, 0, 0, 0]", "has 9 coefficients, not 4, 5, 8, 12 or 14"},
      {"rational", "[0.1, 0, 0, 0, 0, 0.1, 0, 0, 0.01, 0, 0, 0]", "thin prism or a tilted sensor"},
      {"equidistant", "[0.1, 0, 0]", "has 3 coefficients, equidistant has 4"},
      {"fisheye", "[0.1, 0, 0]", "has 3 coefficients, equidistant has 4"}};
  for (const auto& [model, coefficients, part] : cases) {
    const auto message = error(model, coefficients);
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_NE(message.find("cameras[0].distortion."), std::string::npos) << message;
  }
}

/// As cameracalibrator of ROS saves it.
constexpr const char* kRos = R"(image_width: 1280
image_height: 720
camera_name: webcam
camera_matrix:
  rows: 3
  cols: 3
  data: [610.2, 0., 640.1, 0., 611.3, 360.4, 0., 0., 1.]
distortion_model: rational_polynomial
distortion_coefficients:
  rows: 1
  cols: 8
  data: [0.4371, -2.5066, 0.0006, -0.0002, 1.4637, 0.3137, -2.3387, 1.3903]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: [600., 0., 641., 0., 0., 605., 361., 0., 0., 0., 1., 0.]
)";
/// As OpenCV's example program does.
constexpr const char* kOpenCv = R"(%YAML:1.0
---
calibration_time: "Thu Nov 26 02:00:00 2026"
nframes: 20
image_width: 640
image_height: 480
board_width: 9
flags: 16384
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.2e+02, 0., 3.2e+02, 0., 5.21e+02, 2.4e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 8
   cols: 1
   dt: d
   data: [ 2.0e-01, 5.0e-02, 5.0e-04, -3.0e-04, 1.0e-03,
       5.0e-01, 1.5e-01, 1.0e-02 ]
avg_reprojection_error: 2.1e-01
)";

TEST(CalibrationFile, OfOpenCvAndRos) {
  const ScratchFolder folder;
  const auto read = [&](const std::string& text) { return read_calibration(folder.write("c.yaml", text)); };
  const Calibration ros = read(kRos);
  EXPECT_EQ(ros.kind, SensorKind::kMono);
  EXPECT_EQ(ros.invalid_reason(), "");
  EXPECT_EQ(ros.left.pinhole.fy, 611.3);
  EXPECT_EQ(ros.left.pinhole.cx, 640.1);
  EXPECT_EQ(ros.left.pinhole.width, 1280);
  EXPECT_EQ(ros.left.distortion.model, DistortionModel::kRational);
  EXPECT_EQ(ros.left.distortion.coefficients[7], 1.3903);
  const Calibration opencv = read(kOpenCv);
  EXPECT_EQ(opencv.invalid_reason(), "");
  EXPECT_EQ(opencv.left.pinhole.cy, 240);
  EXPECT_EQ(opencv.left.distortion.model, DistortionModel::kRational);
  EXPECT_EQ(opencv.left.distortion.coefficients[5], 0.5);
  // Of a fisheye, four numbers mean something else.
  const std::string four =
      with(with(kOpenCv, "1.0e-03,\n       5.0e-01, 1.5e-01, 1.0e-02 ]", "]"), "-3.0e-04,", "-3.0e-04");
  EXPECT_EQ(read(four).left.distortion.model, DistortionModel::kRadTan);
  EXPECT_EQ(read(with(four, "fisheye_model: 0", "fisheye_model: 1")).left.distortion.model,
            DistortionModel::kEquidistant);
  EXPECT_IO_ERROR(read(with(kOpenCv, "fisheye_model: 0", "fisheye_model: 1")), "equidistant has 4");
  EXPECT_IO_ERROR(read(with(kRos, "[610.2, 0.,", "[610.2, 0.3,")), "is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  EXPECT_IO_ERROR(read(with(kRos, "image_width: 1280\n", "")), "key 'image_width' is missing");
  EXPECT_IO_ERROR(read(with(kRos, "rational_polynomial", "thin_prism")), "is 'thin_prism'");
}

TEST(CalibrationFile, WrittenLensesAreReadBack) {
  const ScratchFolder folder;
  const Distortion lenses[] = {
      {},
      {DistortionModel::kRadTan, {-0.2, 0.05, 0.001, 0.002}},
      {DistortionModel::kRadTan, {-0.2, 0.05, 0.001, 0.002, 0.01}},
      {DistortionModel::kEquidistant, {0.01, 0.02, 0.03, 0.04}},
      {DistortionModel::kRational, {0.4371, -2.5066, 0.0006, -0.0002, 1.4637, 0.3137, -2.3387, 1.39031234}}};
  for (const Distortion& lens : lenses) {
    Calibration written;
    written.kind = SensorKind::kMono;
    written.left = {{610, 611, 640, 360, 1280, 720}, lens};
    write_calibration(folder.path() / "c.yaml", written, {});
    const Calibration c = read_calibration(folder.path() / "c.yaml");
    EXPECT_EQ(c.left.distortion.model, lens.model);
    EXPECT_EQ(c.left.distortion.coefficients, lens.coefficients);
    EXPECT_EQ(c.left.pinhole.fy, 611);
  }
}

TEST(CalibrationFile, AWrittenReadoutIsReadBack) {
  const ScratchFolder folder;
  for (const std::optional<double> readout : {std::optional<double>(), {0.0}, {0.0182}}) {
    Calibration written;
    written.kind = SensorKind::kMono;
    written.left.pinhole = {610, 611, 640, 360, 1280, 720};
    written.readout = readout;
    write_calibration(folder.path() / "c.yaml", written, {});
    EXPECT_EQ(read_calibration(folder.path() / "c.yaml").readout, readout);
  }
}

TEST(CalibrationFile, KalibrChain) {
  const ScratchFolder folder;
  const auto c = read_calibration(folder.write("camchain.yaml", R"(cam0:
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]
  intrinsics: [400, 401, 320, 240]
  resolution: [640, 480]
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.2]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]
  intrinsics: [400, 401, 320, 240]
  resolution: [640, 480]
)"));
  EXPECT_EQ(c.kind, SensorKind::kStereo);
  EXPECT_EQ(c.left.distortion.model, DistortionModel::kEquidistant);
  EXPECT_EQ(c.left.distortion.coefficients[3], 0.04);
  EXPECT_NEAR(c.T_right_left.translation().x(), -0.2, 1e-15);
}

TEST(CalibrationFile, KittiBaseline) {
  const ScratchFolder folder;
  const auto c = read_calibration(folder.write(
      "calib.txt", "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -350 0 700 180 0 0 0 1 0\n"));
  EXPECT_NEAR(c.T_right_left.translation().x(), -0.5, 1e-15);
  EXPECT_TRUE(c.already_rectified);
  EXPECT_IO_ERROR(read_calibration(folder.write("calib.txt", "P0: 700 0 600 0 0 700\n")),
                  "calib.txt:1: key P0: has 6");
  EXPECT_IO_ERROR(read_calibration(folder.write("calib.txt", "P1: 700 0 600 0 0 700 180 0 0 0 1 0\n")),
                  "key 'P0' is missing");
  EXPECT_IO_ERROR(
      read_calibration(folder.write(
          "calib.txt", "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 350 0 700 180 0 0 0 1 0\n")),
      "baseline");
}

}  // namespace
}  // namespace twofold
