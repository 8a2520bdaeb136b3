// In place of the server where Node.js or Boost was missing when the program was built.
#include <stdexcept>

#include "twofold/viewer.hpp"
#include "viewer/server.hpp"

namespace twofold {

class ViewServer::Impl {};

ViewServer::ViewServer(const ViewServerOptions&, const ViewScene&, const ViewTitle&) {
  throw std::runtime_error(
      "this program was built without the viewer; it needs nodejs, npm and libboost-dev (docs/viewer.md)");
}
ViewServer::~ViewServer() = default;

const std::vector<std::string>& ViewServer::addresses() const {
  static const std::vector<std::string> kNone(1);
  return kNone;
}
int ViewServer::port() const {
  return 0;
}
bool ViewServer::is_open_to_network() const {
  return false;
}
void ViewServer::run(const std::stop_token&, const Tick&, const std::function<std::string()>&) {}

bool has_viewer() {
  return false;
}

}  // namespace twofold
