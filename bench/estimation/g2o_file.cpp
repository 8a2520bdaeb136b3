#include "bench/estimation/g2o_file.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <Eigen/Eigenvalues>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

namespace twofold::bench {
namespace {

/// Position in the text, for messages.
struct Place {
  const std::string& name;
  int line;
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(fmt::format("{}:{}: {}", name, line, what));
  }
};

/// Blank-separated fields of one line.
class Fields {
 public:
  Fields(std::string_view line, Place place) : rest_(line), place_(place) {}

  [[nodiscard]] std::string_view word() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\r"), rest_.size()));
    const std::string_view field = rest_.substr(0, rest_.find_first_of(" \t\r"));
    rest_.remove_prefix(field.size());
    return field;
  }
  [[nodiscard]] double number(const char* what) { return parse<double>(what); }
  [[nodiscard]] int id() {
    const int value = parse<int>("vertex id");
    if (value < 0) place_.fail(fmt::format("vertex id {} is negative", value));
    return value;
  }
  template <int N>
  [[nodiscard]] Eigen::Matrix<double, N, 1> vector(const char* what) {
    Eigen::Matrix<double, N, 1> v;
    for (int k = 0; k < N; ++k) v[k] = number(what);
    return v;
  }
  void expect_end() {
    if (const auto extra = word(); !extra.empty()) place_.fail(fmt::format("unexpected field '{}'", extra));
  }
  [[nodiscard]] const Place& place() const { return place_; }

 private:
  template <class T>
  T parse(const char* what) {
    const std::string_view field = word();
    if (field.empty()) place_.fail(fmt::format("the line ends where the {} should stand", what));
    T value{};
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size()) {
      place_.fail(fmt::format("'{}' is not a valid {}", field, what));
    }
    if constexpr (std::is_floating_point_v<T>) {
      if (!std::isfinite(value)) place_.fail(fmt::format("{} is not finite", what));
    }
    return value;
  }

  std::string_view rest_;
  Place place_;
};

SE2 read_pose(Fields& fields, const SE2*) {
  const Vector3 x = fields.vector<3>("pose");
  return {x.z(), x.head<2>()};
}

SE3 read_pose(Fields& fields, const SE3*) {
  const Vector3 t = fields.vector<3>("translation");
  const Eigen::Matrix<double, 4, 1> q = fields.vector<4>("quaternion");  // x y z w
  if (std::abs(q.norm() - 1) > 0.01) {
    fields.place().fail(fmt::format("the quaternion has norm {:.6g}, should have 1", q.norm()));
  }
  return {SO3(Eigen::Quaterniond(q[3], q[0], q[1], q[2])), t};
}

/// g2o's vector part of the quaternion is half of our rotation error; planar errors agree.
Matrix3 rescaled(const Matrix3& information, const SE2*) {
  return information;
}
Matrix6 rescaled(const Matrix6& information, const SE3*) {
  Vector6 d;
  d << 1, 1, 1, 0.5, 0.5, 0.5;
  return d.asDiagonal() * information * d.asDiagonal();
}

template <class Group>
class Reader {
 public:
  void vertex(Fields& fields) {
    const int id = fields.id();
    const Group X = read_pose(fields, kTag);
    fields.expect_end();
    if (!vertices_.emplace(id, X.inverse()).second)
      fields.place().fail(fmt::format("vertex {} stands twice", id));
  }

  void edge(Fields& fields) {
    constexpr int kDof = Group::kDof;
    Edge e{fields.id(), fields.id(), fields.place().line, {}};
    if (e.i == e.j) fields.place().fail(fmt::format("edge joins vertex {} to itself", e.i));
    e.constraint.T_j_i = read_pose(fields, kTag).inverse();
    typename PoseGraph<Group>::Information information;
    for (int r = 0; r < kDof; ++r) {
      for (int c = r; c < kDof; ++c)
        information(r, c) = information(c, r) = fields.number("information entry");
    }
    fields.expect_end();
    const Eigen::SelfAdjointEigenSolver<typename PoseGraph<Group>::Information> eigen(information,
                                                                                      Eigen::EigenvaluesOnly);
    if (!(eigen.eigenvalues()[0] >= -1e-6 * eigen.eigenvalues()[kDof - 1])) {
      fields.place().fail("the information matrix is not positive semi-definite");
    }
    e.constraint.information = rescaled(information, kTag);
    edges_.push_back(e);
  }

  void fix(int id) { fixed_ = id; }

  [[nodiscard]] PoseGraph<Group> graph(const std::string& name) const {
    PoseGraph<Group> graph;
    std::map<int, int> index;
    for (const auto& [id, T] : vertices_) index[id] = 0;
    if (vertices_.empty()) {
      for (const Edge& e : edges_) index[e.i] = index[e.j] = 0;
    }
    for (auto& [id, k] : index) {
      k = static_cast<int>(graph.poses.size());
      graph.poses.push_back(vertices_.empty() ? Group() : vertices_.at(id));
    }
    for (const Edge& e : edges_) {
      for (const int id : {e.i, e.j}) {
        if (!index.contains(id))
          Place{name, e.line}.fail(fmt::format("edge names vertex {}, which is missing", id));
      }
      graph.constraints.push_back(e.constraint);
      graph.constraints.back().i = index[e.i];
      graph.constraints.back().j = index[e.j];
    }
    if (fixed_ && index.contains(*fixed_)) graph.origin = index[*fixed_];
    if (vertices_.empty() && !chain_constraints(graph)) {
      throw std::runtime_error(name + ": the file has no vertices, and its edges do not connect all poses");
    }
    return graph;
  }

 private:
  static constexpr const Group* kTag = nullptr;
  struct Edge {
    int i, j, line;
    typename PoseGraph<Group>::Constraint constraint;
  };
  std::map<int, Group> vertices_;
  std::vector<Edge> edges_;
  std::optional<int> fixed_;
};

std::string read_gzip(const std::string& path) {
  const gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) throw std::runtime_error(path + ": cannot be opened");
  std::string text;
  char buffer[1 << 16];
  int n;
  while ((n = gzread(file, buffer, sizeof buffer)) > 0) text.append(buffer, n);
  int error = Z_OK;
  const std::string message = gzerror(file, &error);
  gzclose(file);
  if (n < 0 || error != Z_OK) throw std::runtime_error(path + ": cannot be decompressed: " + message);
  return text;
}

}  // namespace

AnyPoseGraph parse_g2o(std::string_view text, const std::string& name) {
  Reader<SE2> planar;
  Reader<SE3> spatial;
  bool any_planar = false, any_spatial = false;
  for (int line = 1; !text.empty(); ++line) {
    const std::string_view content = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(content.size() + 1, text.size()));
    const Place place{name, line};
    Fields fields(content, place);
    const std::string_view tag = fields.word();
    if (tag.empty() || tag.front() == '#') continue;
    if (tag == "FIX") {
      const int id = fields.id();
      planar.fix(id);
      spatial.fix(id);
      fields.expect_end();
      continue;
    }
    const bool is_planar = tag == "VERTEX_SE2" || tag == "EDGE_SE2";
    if (!is_planar && tag != "VERTEX_SE3:QUAT" && tag != "EDGE_SE3:QUAT") {
      place.fail(fmt::format(
          "'{}' is not supported; VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX are", tag));
    }
    (is_planar ? any_planar : any_spatial) = true;
    if (any_planar && any_spatial) place.fail("planar and spatial elements in one file");
    const bool vertex = tag.front() == 'V';
    if (is_planar) {
      vertex ? planar.vertex(fields) : planar.edge(fields);
    } else {
      vertex ? spatial.vertex(fields) : spatial.edge(fields);
    }
  }
  AnyPoseGraph graph;
  if (any_planar) {
    graph = planar.graph(name);
  } else {
    graph = spatial.graph(name);
  }
  if (std::visit([](const auto& g) { return g.constraints.empty(); }, graph)) {
    throw std::runtime_error(name + ": there are no edges in the file");
  }
  return graph;
}

AnyPoseGraph read_g2o(const std::string& path) {
  if (path.ends_with(".gz")) return parse_g2o(read_gzip(path), path);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path + ": cannot be opened");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  if (file.bad()) throw std::runtime_error(path + ": cannot be read");
  return parse_g2o(text, path);
}

}  // namespace twofold::bench
