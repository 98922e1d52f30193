#include "server/dds/handlers.h"

namespace trammel {

Result<wire::DiagnoseReply> Handlers::answer(const wire::DiagnoseRequest& request) {
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  wire::DiagnoseReply reply;
  reply.header().result(wire::RESULT_UNSUPPORTED);
  reply.header().message("Diagnose is not offered by this version of the service; `trammel diagnose` works on files");
  return reply;
}

bool happens_once(const wire::DiagnoseRequest&) { return false; }

}  // namespace trammel
