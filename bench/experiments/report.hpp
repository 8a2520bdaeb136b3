#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace twofold::bench {

/// One statement of a paper, what was measured, and whether it holds.
struct Statement {
  std::string source;    ///< e.g. "SWF fig. 13"
  std::string text;      ///< the statement with its bound
  std::string measured;  ///< the figures
  bool holds = false;
};

/// Results of one experiment program: CSV tables, plots' folder, statements.
class Report {
 public:
  /// Creates the folder; throws std::runtime_error naming it when that fails.
  explicit Report(const std::filesystem::path& folder);

  void csv(const std::string& name, const std::vector<std::string>& columns,
           const std::vector<std::vector<double>>& rows) const;
  void state(const std::string& source, const std::string& text, const std::string& measured, bool holds);
  [[nodiscard]] nlohmann::json& json() { return json_; }
  [[nodiscard]] std::string file(const std::string& name) const { return (folder_ / name).string(); }
  /// Table of all statements, also written to statements.txt and results.json.
  [[nodiscard]] std::string finish();
  [[nodiscard]] const std::vector<Statement>& statements() const { return statements_; }

 private:
  std::filesystem::path folder_;
  nlohmann::json json_;
  std::vector<Statement> statements_;
};

/// printf into a string.
[[nodiscard]] std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));

/// Slope of a least-squares line through (log x, log y).
[[nodiscard]] double fitted_exponent(const std::vector<double>& x, const std::vector<double>& y);

}  // namespace twofold::bench
