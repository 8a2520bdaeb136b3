#include "experiments/report.hpp"

#include <cmath>
#include <cstdarg>
#include <fstream>
#include <stdexcept>

namespace twofold::bench {

Report::Report(const std::filesystem::path& folder) : folder_(folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error("cannot create the folder " + folder.string() + ": " + error.message());
}

void Report::csv(const std::string& name, const std::vector<std::string>& columns,
                 const std::vector<std::vector<double>>& rows) const {
  std::ofstream out(folder_ / name);
  for (std::size_t c = 0; c < columns.size(); ++c) out << (c ? "," : "") << '"' << columns[c] << '"';
  out << '\n';
  out.precision(9);
  for (const auto& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) out << (c ? "," : "") << row[c];
    out << '\n';
  }
  if (!out) throw std::runtime_error("cannot write " + (folder_ / name).string());
}

void Report::state(const std::string& source, const std::string& statement, const std::string& measured,
                   bool holds) {
  statements_.push_back({source, statement, measured, holds});
}

std::string Report::finish() {
  std::string table;
  auto list = nlohmann::json::array();
  for (const Statement& s : statements_) {
    table += (s.holds ? "holds   " : "FAILS   ") + s.source + ": " + s.text +
             "\n            measured: " + s.measured + "\n";
    list.push_back(
        {{"source", s.source}, {"statement", s.text}, {"measured", s.measured}, {"holds", s.holds}});
  }
  json_["statements"] = list;
  std::ofstream(folder_ / "statements.txt") << table;
  std::ofstream out(folder_ / "results.json");
  out << json_.dump(1) << '\n';
  if (!out) throw std::runtime_error("cannot write " + (folder_ / "results.json").string());
  return table;
}

std::string text(const char* format, ...) {
  char buffer[1024];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof buffer, format, arguments);
  va_end(arguments);
  return buffer;
}

double fitted_exponent(const std::vector<double>& x, const std::vector<double>& y) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  const auto n = static_cast<double>(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double u = std::log(x[i]), v = std::log(y[i]);
    sx += u;
    sy += v;
    sxx += u * u;
    sxy += u * v;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

}  // namespace twofold::bench
