#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/dds/request_call.h"

namespace trammel::test {

/// The calls of one operation, carried out at once and without DDS.
template <typename Operation>
class Answered final : private ReplySink {
 public:
  using Request = typename Operation::Request::type;
  using Reply = typename Operation::Reply::type;

  Answered(Handlers& handlers, const std::string& server_id)
      : context_{server_id, "replies", handlers, *this, counts_} {}

  [[nodiscard]] Reply reply_to(const Request& request) {
    const auto call = this->call(request);
    if (const std::size_t items = call->begin(); items > 0) call->compute(0, items);
    call->finish();
    return replies_.back();
  }
  [[nodiscard]] Reply shed(const Request& request, const Shed& shed) {
    call(request)->shed(shed);
    return replies_.back();
  }
  [[nodiscard]] const CallCounts& counts() const { return counts_; }

 private:
  std::unique_ptr<Call<Operation>> call(const Request& request) {
    const std::string id = request_id_text(request.header().request_id());
    auto received = std::make_unique<wire::Received<Request>>();
    static_cast<Request&>(*received) = request;
    return std::make_unique<Call<Operation>>(context_, std::move(received), ReplyAddress{}, id,
                                             nullptr);
  }
  void send(const ReplyAddress&, std::shared_ptr<void> reply, std::size_t) override {
    replies_.push_back(*static_cast<Reply*>(reply.get()));
  }
  void post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override {
    send(to, std::move(reply), bytes);
  }

  CallCounts counts_;
  std::vector<Reply> replies_;
  CallContext<Operation> context_;
};

}  // namespace trammel::test
