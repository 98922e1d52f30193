#include "idl/limits.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {
namespace {

/// Room for everything but the texts in the largest sample.
constexpr std::size_t kMaxText = wire::kMaxTextSample - 65536;

}  // namespace

Result<wire::DiagnoseReply> Handlers::answer(const wire::DiagnoseRequest& request) {
  const std::string& cell = request.about().cell();
  if (const auto known = subjects_.cell(request.about()); !known) return tl::make_unexpected(known.error());
  wire::DiagnoseReply reply;
  if (const auto served = registry_.in_force(cell)) reply.model(to_wire(*served, true, unix_now_s()));
  if (request.job() == 0) {
    const auto job = trainer_.diagnose(cell, request.batch_id(), request.csv(), request.apply());
    if (!job) return tl::make_unexpected(job.error());
    reply.job(*job);
    return reply;
  }
  const auto asked = trainer_.progress(request.job());
  if (!asked) return tl::make_unexpected(asked.error());
  if (asked->cell != cell)
    return failure(ErrorCode::kNotFound, "job {} is not of cell {}", request.job(), cell)
        .of("job")
        .with_value(request.job());
  auto found = trainer_.diagnosis(request.job());
  if (!found) return tl::make_unexpected(found.error());
  reply.job(request.job());
  if (request.page()) reply.page_html(std::move(found->page));
  if (found->findings.size() + reply.page_html().size() > kMaxText) {
    return failure(ErrorCode::kTooLarge, "what job {} found has {} bytes, limit {}; ask without the page",
                   request.job(), found->findings.size() + reply.page_html().size(), kMaxText);
  }
  reply.findings_json(std::move(found->findings));
  return reply;
}

bool happens_once(const wire::DiagnoseRequest& request) { return request.job() == 0; }

}  // namespace trammel
