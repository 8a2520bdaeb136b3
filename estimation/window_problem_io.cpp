#include "estimation/window_problem_io.hpp"

#include <charconv>
#include <cmath>
#include <fstream>
#include <ostream>
#include <stdexcept>
#include <string_view>

#include "estimation/field_reader.hpp"

namespace twofold {
namespace {

constexpr const char* kKindNames[] = {"mono", "stereo", "rgbd"};

class LineWriter {
 public:
  explicit LineWriter(std::ostream& out) : out_(out) {}
  ~LineWriter() { out_ << '\n'; }
  template <class Number>
  LineWriter& operator<<(Number value) {
    char text[40];
    const auto end = std::to_chars(text, text + sizeof text, value).ptr;  // shortest that reads back
    if (!first_) out_ << ' ';
    first_ = false;
    out_.write(text, end - text);
    return *this;
  }
  LineWriter& operator<<(const SE3& T) {
    for (const double value : T.so3().quaternion().coeffs()) *this << value;
    for (const double value : T.translation()) *this << value;
    return *this;
  }

 private:
  std::ostream& out_;
  bool first_ = true;
};

SE3 read_pose(FieldReader& reader) {
  Eigen::Quaterniond q;
  Vector3 t;
  for (double& value : q.coeffs()) value = reader.number<double>();
  for (double& value : t) value = reader.number<double>();
  if (!(std::abs(q.norm() - 1) < 1e-6)) reader.fail("quaternion is not of unit length");
  if (!t.allFinite()) reader.fail("translation is not finite");
  return {SO3(q), t};
}

/// "keyword N"
int read_section(FieldReader& reader, const char* keyword) {
  reader.next(2, keyword);
  if (reader.word() != keyword) reader.fail(std::string("expected '") + keyword + "'");
  return reader.count();
}

Rig read_rig(FieldReader& reader) {
  reader.next(9, "rig");
  if (reader.word() != "rig") reader.fail("expected 'rig'");
  Rig rig;
  const std::string_view kind = reader.word();
  bool known = false;
  for (int n = 0; n < 3; ++n) {
    if (kind == kKindNames[n]) rig.kind = static_cast<SensorKind>(n), known = true;
  }
  if (!known) reader.fail(std::string("unknown sensor '").append(kind).append("'"));
  auto& camera = rig.camera;
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value = reader.number<double>();
  camera.width = reader.count();
  camera.height = reader.count();
  rig.baseline = reader.number<double>();
  if (!(camera.fx > 0) || !(camera.fy > 0)) reader.fail("focal lengths must be positive");
  if (!(rig.baseline >= 0)) reader.fail("baseline must not be negative");
  return rig;
}

void read_points(FieldReader& reader, WindowProblem& problem) {
  const int count = read_section(reader, "points");
  for (int k = 0; k < count; ++k) {
    reader.next(5, "point");
    WindowProblem::Point point;
    point.anchor = reader.number<int>();
    for (double& value : point.psi) value = reader.number<double>();
    point.observation_count = reader.count();
    point.first_observation = static_cast<int>(problem.observations.size());
    for (int n = 0; n < point.observation_count; ++n) {
      reader.next(7, "observation");
      WindowProblem::Observation o;
      o.pose = reader.number<int>();
      for (float& value : o.z) value = reader.number<float>();
      for (float& value : o.information) value = reader.number<float>();
      problem.observations.push_back(o);
    }
    problem.points.push_back(point);
  }
}

void read_constraints(FieldReader& reader, WindowProblem& problem) {
  const int count = read_section(reader, "constraints");
  for (int n = 0; n < count; ++n) {
    reader.next(30, "constraint");
    WindowProblem::PoseConstraint c;
    c.i = reader.number<int>();
    c.j = reader.number<int>();
    c.T_j_i = read_pose(reader);
    for (int row = 0; row < 6; ++row) {
      for (int col = row; col < 6; ++col) {
        c.information(row, col) = c.information(col, row) = reader.number<double>();
      }
    }
    problem.constraints.push_back(c);
  }
}

}  // namespace

void write_window_problem(std::ostream& out, const WindowProblem& problem) {
  const auto& camera = problem.rig.camera;
  out << "twofold_window 1\nrig " << kKindNames[static_cast<int>(problem.rig.kind)] << ' ';
  LineWriter(out) << camera.fx << camera.fy << camera.cx << camera.cy << camera.width << camera.height
                  << problem.rig.baseline;
  out << "poses " << problem.poses.size() << '\n';
  for (const auto& pose : problem.poses) LineWriter(out) << (pose.fixed ? 1 : 0) << pose.T_k_w;
  out << "points " << problem.points.size() << '\n';
  for (const auto& point : problem.points) {
    LineWriter(out) << point.anchor << point.psi.x() << point.psi.y() << point.psi.z()
                    << point.observation_count;
    for (int n = 0; n < point.observation_count; ++n) {
      const auto& o = problem.observations[point.first_observation + n];
      LineWriter(out) << o.pose << o.z.x() << o.z.y() << o.z.z() << o.information.x() << o.information.y()
                      << o.information.z();
    }
  }
  out << "constraints " << problem.constraints.size() << '\n';
  for (const auto& c : problem.constraints) {
    LineWriter line(out);
    line << c.i << c.j << c.T_j_i;
    for (int row = 0; row < 6; ++row) {
      for (int col = row; col < 6; ++col) line << c.information(row, col);
    }
  }
}

WindowProblem read_window_problem(std::istream& in, const std::string& name) {
  FieldReader reader(in, name);
  reader.next(2, "twofold_window");
  if (reader.word() != "twofold_window") reader.fail("not a window problem");
  if (reader.number<int>() != 1) reader.fail("unknown version");
  WindowProblem problem;
  problem.rig = read_rig(reader);
  const int poses = read_section(reader, "poses");
  for (int i = 0; i < poses; ++i) {
    reader.next(8, "pose");
    const int fixed = reader.number<int>();
    if (fixed != 0 && fixed != 1) reader.fail("fixed must be 0 or 1");
    problem.poses.push_back({read_pose(reader), fixed == 1});
  }
  read_points(reader, problem);
  read_constraints(reader, problem);
  if (const std::string reason = invalid_reason(problem); !reason.empty()) {
    throw std::runtime_error(name + ": " + reason);
  }
  return problem;
}

WindowProblem read_window_problem(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error(file.string() + ": cannot be opened");
  return read_window_problem(in, file.string());
}

}  // namespace twofold
