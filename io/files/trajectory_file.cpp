#include "io/files/trajectory_file.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "evaluation/tum_line.hpp"

#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/files/text_file.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;
using Fields = std::vector<std::string_view>;

Fields fields_of(const fs::path& file, const TextLine& line, std::size_t count, std::string_view separators) {
  Fields fields = split_fields(line.text, separators);
  if (fields.size() < count || (separators == " \t" && fields.size() != count)) {
    throw IoError(file, line.number, fmt::format("has {} fields, {} are needed", fields.size(), count));
  }
  return fields;
}

Vector3 vector_at(const fs::path& file, int line, const Fields& fields, std::size_t first) {
  return {number_field(file, line, fields[first]), number_field(file, line, fields[first + 1]),
          number_field(file, line, fields[first + 2])};
}

SO3 checked_rotation(const fs::path& file, int line, const Eigen::Quaterniond& q) {
  constexpr double kTolerance = 0.01;  // files carry four decimals and more
  if (std::abs(q.norm() - 1) > kTolerance) {
    throw IoError(file, line, fmt::format("the quaternion has length {:.4f}, not 1", q.norm()));
  }
  return SO3(q);
}

/// The benchmark's motion capture has stamps of four decimals, and two of its measurements can round to the
/// same one (fr2_desk has such a pair). They then differ, but hardly.
bool rounded_to_same_time(const TimedPose& first, const TimedPose& second) {
  constexpr double kMaxTranslation = 0.02;  // [m]
  constexpr double kMaxRotation = 0.035;    // [rad]
  const Vector6 difference = (first.T_w_c.inverse() * second.T_w_c).log();
  return first.t_ns == second.t_ns && difference.norm() > 0 &&
         difference.head<3>().norm() < kMaxTranslation && difference.tail<3>().norm() < kMaxRotation;
}

/// The last line was not written to its end: fields are missing, or the last one is shorter than those of the
/// lines before, all of which have the same decimals.
bool is_cut(const std::vector<TextLine>& lines) {
  if (lines.empty() || lines.back().ended) return false;
  const Fields last = split_fields(lines.back().text);
  if (last.size() != 8 || lines.size() == 1) return last.size() < 8;
  const auto decimals = [](std::string_view number) {
    const auto point = number.find('.');
    return point == std::string_view::npos ? 0 : number.size() - point;
  };
  const Fields before = split_fields(lines[lines.size() - 2].text);
  return decimals(last.back()) < decimals(before.back());
}

std::int64_t time_field(const fs::path& file, int line, std::string_view field,
                        std::optional<TimeUnit> unit) {
  if (!unit) return seconds_field(file, line, field);
  const auto t_ns = time_to_ns(field, *unit);
  if (!t_ns) throw IoError(file, line, fmt::format("'{}' is not a time stamp in {}", field, name_of(*unit)));
  return *t_ns;
}

}  // namespace

Trajectory read_tum_trajectory(const fs::path& file, const TumReading& how, std::string* note) {
  std::vector<TextLine> lines = read_table_lines(file);
  if (how.cut == CutLine::kLeftOut && is_cut(lines)) {
    if (note != nullptr)
      *note = fmt::format("{}:{}: the last line is cut, and left out", file.string(), lines.back().number);
    lines.pop_back();
  }
  Trajectory trajectory;
  std::int64_t previous = -1;
  for (const TextLine& line : lines) {
    const Fields fields = fields_of(file, line, 8, " \t");
    const std::int64_t t_ns = time_field(file, line.number, fields[0], how.unit);
    const Vector3 q_xyz = vector_at(file, line.number, fields, 4);
    const Eigen::Quaterniond q(number_field(file, line.number, fields[7]), q_xyz.x(), q_xyz.y(), q_xyz.z());
    const TimedPose pose{
        t_ns, SE3(checked_rotation(file, line.number, q), vector_at(file, line.number, fields, 1))};
    if (how.order == TimeOrder::kIncreasing) {
      if (!trajectory.empty() && rounded_to_same_time(trajectory.back(), pose)) continue;
      expect_increasing(file, line.number, t_ns, &previous);
    }
    trajectory.push_back(pose);
  }
  return trajectory;
}

namespace {

/// From the first twelve numbers of a matrix, row by row.
SE3 pose_of_rows(const fs::path& file, int line, const Fields& fields) {
  Eigen::Matrix<double, 3, 4> M;
  for (int i = 0; i < 12; ++i)
    M(i / 4, i % 4) = number_field(file, line, fields[static_cast<std::size_t>(i)]);
  const Matrix3 R = M.leftCols<3>();
  constexpr double kTolerance = 0.01;
  if ((R * R.transpose() - Matrix3::Identity()).norm() > kTolerance || R.determinant() < 0) {
    throw IoError(file, line, "the 3x3 part is not a rotation");
  }
  return {R, Vector3(M.col(3))};
}

Trajectory read_matrices(const fs::path& file, std::size_t numbers) {
  Trajectory trajectory;
  for (const TextLine& line : read_table_lines(file)) {
    const Fields fields = fields_of(file, line, numbers, " \t");
    trajectory.push_back(
        {static_cast<std::int64_t>(trajectory.size()), pose_of_rows(file, line.number, fields)});
  }
  return trajectory;
}

}  // namespace

Trajectory read_kitti_trajectory(const fs::path& file) {
  return read_matrices(file, 12);
}
Trajectory read_matrix_trajectory(const fs::path& file) {
  return read_matrices(file, 16);
}

std::optional<SE3> read_pose_matrix(const fs::path& file) {
  const auto lines = read_text_lines(file);
  Fields fields;
  for (const TextLine& line : lines)
    for (const std::string_view field : split_fields(line.text)) fields.push_back(field);
  if (fields.size() != 16)
    throw IoError(file, fmt::format("has {} numbers, a 4x4 matrix has 16", fields.size()));
  for (std::string_view field : fields) {
    if (field.starts_with('-')) field.remove_prefix(1);
    if (field == "inf" || field == "nan") return std::nullopt;
  }
  return pose_of_rows(file, lines.front().number, fields);
}

Trajectory read_euroc_trajectory(const fs::path& file) {
  Trajectory trajectory;
  std::int64_t previous = -1;
  for (const TextLine& line : read_table_lines(file)) {
    const Fields fields = fields_of(file, line, 8, ", \t");
    const std::int64_t t_ns = nanoseconds_field(file, line.number, fields[0]);
    const Vector3 q_xyz = vector_at(file, line.number, fields, 5);
    const Eigen::Quaterniond q(number_field(file, line.number, fields[4]), q_xyz.x(), q_xyz.y(), q_xyz.z());
    expect_increasing(file, line.number, t_ns, &previous);
    trajectory.push_back(
        {t_ns, SE3(checked_rotation(file, line.number, q), vector_at(file, line.number, fields, 1))});
  }
  return trajectory;
}

TrajectoryForm trajectory_form(const fs::path& file) {
  const auto lines = read_table_lines(file);
  if (lines.empty()) throw IoError(file, "holds no poses");
  const std::string& first = lines[0].text;
  if (first.find(',') != std::string::npos) return TrajectoryForm::kEuroc;
  const auto count = split_fields(first).size();
  if (count == 8) return TrajectoryForm::kTum;
  if (count == 12) return TrajectoryForm::kKitti;
  throw IoError(file, lines[0].number,
                fmt::format("{} fields: neither TUM (8), KITTI (12) nor EuRoC form", count));
}

Trajectory read_trajectory(const fs::path& file) {
  switch (trajectory_form(file)) {
    case TrajectoryForm::kTum:
      return read_tum_trajectory(file);
    case TrajectoryForm::kKitti:
      return read_kitti_trajectory(file);
    case TrajectoryForm::kEuroc:
      break;
  }
  return read_euroc_trajectory(file);
}

void write_tum_trajectory(const fs::path& file, const Trajectory& trajectory) {
  OutputFile output(file);
  output.write(kTumHeader);
  for (const TimedPose& pose : trajectory) output.write(tum_line(pose));
  output.close();
}

}  // namespace twofold
