#include "io/bags/bag_cameras.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/bytes.hpp"
#include "tests/io/bags/small_bag.hpp"

namespace twofold {
namespace {

using namespace testing;

std::vector<BagTopic> topics(const std::vector<std::pair<std::string, std::string>>& names) {
  std::vector<BagTopic> topics;
  topics.reserve(names.size());
  for (const auto& [name, type] : names)
    topics.push_back(
        {static_cast<std::uint32_t>(topics.size()), name, "sensor_msgs/" + type, MessageEncoding::kRos1});
  return topics;
}

/// "left | right | depth" of what was chosen, or why nothing was.
std::string chosen(const std::vector<std::pair<std::string, std::string>>& names,
                   const WantedTopics& wanted = {}) {
  try {
    const BagCameras cameras = choose_cameras(topics(names), wanted);
    const auto name = [](const std::optional<BagCamera>& camera) {
      return camera ? camera->images.name : std::string("-");
    };
    return cameras.left.images.name + " | " + name(cameras.right) + " | " + name(cameras.depth);
  } catch (const MalformedBytes& error) {
    return error.what();
  }
}

TEST(BagCameras, AreFoundByTypeAndName) {
  EXPECT_EQ(chosen({{"/cam0/image_raw", "Image"}, {"/cam1/image_raw", "Image"}, {"/imu0", "Imu"}}),
            "/cam0/image_raw | /cam1/image_raw | -");
  EXPECT_EQ(chosen({{"/camera/rgb/image_color", "Image"}, {"/camera/depth/image", "Image"}}),
            "/camera/rgb/image_color | - | /camera/depth/image");
  EXPECT_EQ(chosen({{"/usb_cam/image_raw", "Image"}, {"/usb_cam/image_raw/compressed", "CompressedImage"}}),
            "/usb_cam/image_raw | - | -");
  EXPECT_EQ(chosen({{"/s/left/image_raw", "Image"},
                    {"/s/left/image_rect", "Image"},
                    {"/s/right/image_raw", "Image"},
                    {"/s/right/image_rect", "Image"}}),
            "/s/left/image_rect | /s/right/image_rect | -");
  EXPECT_EQ(chosen({{"/camera/infra1/image_rect_raw/compressed", "CompressedImage"},
                    {"/camera/infra2/image_rect_raw/compressed", "CompressedImage"}}),
            "/camera/infra1/image_rect_raw/compressed | /camera/infra2/image_rect_raw/compressed | -");
}

TEST(BagCameras, AreRectifiedWhereAWordOfTheTopicSaysSo) {
  const auto rectified = [](const std::string& name) {
    return choose_cameras(topics({{name, "Image"}}), {}).left.rectified();
  };
  for (const char* name :
       {"/cam/image_rect", "/cam/image_rect_color/compressed", "/left/image_rectified", "/rect/image"})
    EXPECT_TRUE(rectified(name)) << name;
  for (const char* name : {"/cam/image_raw", "/direct_cam/image_raw", "/corrected", "/rectangle/image_raw"})
    EXPECT_FALSE(rectified(name)) << name;
}

TEST(BagCameras, AreThoseThatTheUserNames) {
  const std::vector<std::pair<std::string, std::string>> names{
      {"/front", "Image"}, {"/back", "Image"}, {"/range", "Image"}, {"/imu", "Imu"}};
  EXPECT_EQ(chosen(names, {"/front", "/back", {}}), "/front | /back | -");
  EXPECT_EQ(chosen(names, {"/front", {}, "/range"}), "/front | - | /range");
  EXPECT_NE(chosen(names).find("there are: /front, /back, /range"), std::string::npos);
  EXPECT_NE(chosen(names, {"/imu", {}, {}}).find("no image topic '/imu'"), std::string::npos);
  EXPECT_NE(chosen(names, {{}, "/back", {}}).find("goes left"), std::string::npos);
  EXPECT_NE(chosen({{"/imu", "Imu"}}).find("there are: none"), std::string::npos);
}

CameraInfoMessage message_of(const WrittenCameraInfo& info) {
  return parse_camera_info(camera_info_message(MessageEncoding::kRos1, info), MessageEncoding::kRos1);
}

BagCameras stereo(const std::string& images) {
  return choose_cameras(topics({{"/left/" + images, "Image"},
                                {"/right/" + images, "Image"},
                                {"/left/camera_info", "CameraInfo"},
                                {"/right/camera_info", "CameraInfo"}}),
                        {});
}

TEST(BagCameras, InfoStandsBesideTheImages) {
  const BagCameras cameras = stereo("image_raw/compressed");
  ASSERT_TRUE(cameras.left.info);
  EXPECT_EQ(cameras.left.info->name, "/left/camera_info");
  EXPECT_EQ(cameras.right->info->name, "/right/camera_info");
}

TEST(BagCameras, RectifiedPairsAreTakenAsTheyAre) {
  const Calibration calibration = calibration_of(stereo("image_rect"), message_of(rectified_info(false)),
                                                 message_of(rectified_info(true)));
  EXPECT_EQ(calibration.invalid_reason(), "");
  EXPECT_TRUE(calibration.already_rectified);
  EXPECT_LT((calibration.T_right_left.translation() - Vector3(-0.2, 0, 0)).norm(), 1e-12);
}

/// A pair of which neither is where the rectified images' coordinates begin, as KITTI's in colour.
TEST(BagCameras, TheBaselineIsFromTheLeftCameraToTheRightOne) {
  WrittenCameraInfo left = rectified_info(false), right = rectified_info(true);
  left.P[3] = 3;
  for (const char* images : {"image_rect", "image_raw"}) {
    const Calibration calibration = calibration_of(stereo(images), message_of(left), message_of(right));
    EXPECT_LT((calibration.T_right_left.translation() - Vector3(-0.26, 0, 0)).norm(), 1e-12) << images;
  }
}

/// The cameras are turned towards each other by what their R say.
TEST(BagCameras, RawPairsKeepTheirLensAndTheirTurn) {
  WrittenCameraInfo left = rectified_info(false), right = rectified_info(true);
  left.D = right.D = {0.1, -0.05, 0.001, 0.002, 0};
  const SO3 R_rect_left = SO3::exp(Vector3(0.01, -0.02, 0.03));
  const SO3 R_rect_right = SO3::exp(Vector3(-0.02, 0.01, 0.01));
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(left.R.data()) = R_rect_left.matrix();
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(right.R.data()) = R_rect_right.matrix();
  const Calibration calibration = calibration_of(stereo("image_raw"), message_of(left), message_of(right));
  EXPECT_EQ(calibration.invalid_reason(), "");
  EXPECT_FALSE(calibration.already_rectified);
  EXPECT_EQ(calibration.left.distortion.model, DistortionModel::kRadTan);
  // A point far ahead of the rectified left camera is 0.2 m further left in the rectified right one.
  const Vector3 rectified(0.3, 0.1, 5);
  const Vector3 of_left = R_rect_left.inverse() * rectified;
  const Vector3 of_right = R_rect_right.inverse() * Vector3(rectified - Vector3(0.2, 0, 0));
  EXPECT_LT((calibration.T_right_left * of_left - of_right).norm(), 1e-9);
  // Of a left camera that was recorded rectified, that turn is in the images.
  BagCameras mixed = stereo("image_raw");
  mixed.left = stereo("image_rect").left;
  const Calibration half = calibration_of(mixed, message_of(left), message_of(right));
  EXPECT_FALSE(half.already_rectified);
  EXPECT_EQ(half.left.distortion.model, DistortionModel::kNone);
  EXPECT_LT((half.T_right_left * rectified - of_right).norm(), 1e-9);
}

/// P = K' [I | t]: a shift along the axis is in the first two rows, too, by the principal point.
void put_shift(const Vector3& t, WrittenCameraInfo* info) {
  auto& P = info->P;
  P[3] = P[0] * t.x() + P[2] * t.z();
  P[7] = P[5] * t.y() + P[6] * t.z();
  P[11] = t.z();
}

TEST(BagCameras, RawPairsStandWhereAllOfPSays) {
  const WrittenCameraInfo left = rectified_info(false);
  WrittenCameraInfo right = rectified_info(true);
  const Vector3 t(-0.2, 0.02, -0.01);
  put_shift(t, &right);
  const Calibration calibration = calibration_of(stereo("image_raw"), message_of(left), message_of(right));
  EXPECT_EQ(calibration.invalid_reason(), "");
  EXPECT_LT((calibration.T_right_left.translation() - t).norm(), 1e-12);
}

/// KITTI's colour cameras stand 3 mm apart in height.
TEST(BagCameras, RectifiedPairsThatDoNotStandSideBySideAreRectifiedOnceMore) {
  const auto pair = [](const Vector3& t) {
    const WrittenCameraInfo left = rectified_info(false);
    WrittenCameraInfo right = rectified_info(true);
    put_shift(t, &right);
    return calibration_of(stereo("image_rect"), message_of(left), message_of(right));
  };
  EXPECT_TRUE(pair({-0.2, 1e-6, -1e-6}).already_rectified) << "rounded numbers";
  EXPECT_EQ(pair({-0.2, 1e-6, -1e-6}).invalid_reason(), "");
  for (const Vector3& t : {Vector3(-0.2, 0.003, 0), Vector3(-0.2, 0, 0.01)}) {
    const Calibration calibration = pair(t);
    EXPECT_FALSE(calibration.already_rectified);
    EXPECT_EQ(calibration.invalid_reason(), "");
    EXPECT_LT((calibration.T_right_left.translation() - t).norm(), 1e-12);
  }
  const std::string above = pair({0, -0.2, 0}).invalid_reason();
  EXPECT_NE(above.find("must lie mainly along +x"), std::string::npos) << above;
}

/// As the drivers of depth sensors publish their lenses.
TEST(BagCameras, KnowTheRationalModel) {
  const std::vector<double> eight{0.4371, -2.5066, 0.0006, -0.0002, 1.4637, 0.3137, -2.3387, 1.3903};
  const auto lens = [](const std::string& model, const std::vector<double>& D) {
    WrittenCameraInfo info = rectified_info(false);
    info.model = model;
    info.D = D;
    const BagCameras camera =
        choose_cameras(topics({{"/rgb/image_raw", "Image"}, {"/rgb/camera_info", "CameraInfo"}}), {});
    const Calibration calibration = calibration_of(camera, message_of(info), {});
    EXPECT_EQ(calibration.invalid_reason(), "");
    return calibration.left.distortion;
  };
  std::vector<double> fourteen = eight;
  fourteen.resize(14);
  for (const auto& [model, D] :
       {std::pair("rational_polynomial", eight), {"rational_polynomial", fourteen}, {"plumb_bob", eight}}) {
    const Distortion distortion = lens(model, D);
    EXPECT_EQ(distortion.model, DistortionModel::kRational);
    EXPECT_TRUE(std::equal(eight.begin(), eight.end(), distortion.coefficients.begin()));
  }
  EXPECT_EQ(lens("rational_polynomial", {0.1, -0.2, 0, 0, 0.05, 0, 0, 0}).model, DistortionModel::kRadTan);
  EXPECT_EQ(lens("plumb_bob", {0.1, -0.2, 0, 0, 0.05}).coefficients[4], 0.05);
  EXPECT_EQ(lens("plumb_bob", {0.1, -0.2}).coefficients[1], -0.2) << "zeros may be left out";
  EXPECT_EQ(lens("rational_polynomial", {0.1, -0.2, 0, 0, 0.05, 0.2}).coefficients[5], 0.2);
  EXPECT_EQ(lens("rational_polynomial", std::vector<double>(8, 0.0)).model, DistortionModel::kNone);
  EXPECT_EQ(lens("equidistant", std::vector<double>(4, 0.0)).model, DistortionModel::kEquidistant)
      << "a fisheye without coefficients is no pinhole";
  EXPECT_EQ(lens("equidistant", {}).model, DistortionModel::kNone);
}

TEST(BagCameras, SayWhatTheInfoLacks) {
  const auto why = [](const WrittenCameraInfo& left, const WrittenCameraInfo& right) {
    try {
      (void)calibration_of(stereo("image_raw"), message_of(left), message_of(right));
    } catch (const MalformedBytes& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const WrittenCameraInfo left = rectified_info(false), right = rectified_info(true);
  EXPECT_EQ(why(left, right), "");
  WrittenCameraInfo uncalibrated = left;
  uncalibrated.K = {};
  EXPECT_NE(why(uncalibrated, right).find("not calibrated"), std::string::npos);
  EXPECT_NE(why(left, left).find("no baseline"), std::string::npos);
  WrittenCameraInfo no_number = right;
  no_number.P[7] = std::nan("");
  EXPECT_NE(why(left, no_number).find("no baseline"), std::string::npos);
  WrittenCameraInfo longer = right;
  longer.P[0] = 51;
  EXPECT_NE(why(left, longer).find("focal lengths differ (P[0]: 50 and 51)"), std::string::npos);
  WrittenCameraInfo strange = left;
  const auto why_strange = [&](const std::string& model, const std::vector<double>& D) {
    strange.model = model;
    strange.D = D;
    return why(strange, right);
  };
  EXPECT_NE(why_strange("omnidirectional", {1}).find("'omnidirectional' is not known"), std::string::npos);
  EXPECT_NE(why_strange("plumb_bob", {1, 1, 1, 1, 1, 1}).find("'plumb_bob' has 6 coefficients"),
            std::string::npos);
  EXPECT_NE(why_strange("equidistant", {1, 1, 1, 1, 1}).find("'equidistant' has 5 coefficients"),
            std::string::npos);
  const std::vector<double> tilted{1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0.01, 0};
  EXPECT_NE(why_strange("rational_polynomial", tilted).find("tilted sensor"), std::string::npos);
  WrittenCameraInfo bent = left;
  bent.R = {1, 1, 1, 1, 1, 1, 1, 1, 1};
  EXPECT_NE(why(bent, right).find("no rotation"), std::string::npos);
}

}  // namespace
}  // namespace twofold
