#include "clients/session/convert.h"

namespace trammel::client {

wire::Context to_wire(const CallContext& context) {
  wire::Context result;
  result.cell(context.cell);
  result.tool(context.tool);
  result.payload(context.payload);
  result.controller_compensates(context.controller_compensates);
  result.model(context.model);
  return result;
}

ServerStatus from_wire(const wire::ServiceStatus& status) {
  ServerStatus result;
  result.server_id = status.server().to_string();
  result.version = status.program_version();
  result.state = status.state() == wire::SERVICE_SERVING ? "serving" : "stopping";
  result.cells = status.cells();
  result.requests = status.requests();
  result.refused = status.refused();
  result.shed = status.shed();
  result.unheard = status.unheard();
  result.misdirected = status.misdirected();
  result.unreadable = status.unreadable();
  result.lost = status.lost();
  result.trouble = status.trouble();
  result.uptime_s = status.uptime_s();
  result.queued_jobs = status.queued_jobs();
  return result;
}

}  // namespace trammel::client
