#include "tests/support/failing_over.h"

#include <chrono>
#include <sstream>

#include "server/base/text_file.h"
#include "server/store/audit.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_cell.h"

namespace trammel::test {
namespace {

constexpr std::chrono::seconds kLimit{180};

std::set<std::string> lines_of(const std::string& text) {
  std::set<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.insert(line);
  return lines;
}

}  // namespace

FailingOver::FailingOver() {
  if (!why_not().empty()) return;
  url = record.new_store();
  first = std::make_unique<Daemon>(0);
  second = std::make_unique<Daemon>(1);
  Daemon trains(2);
  start(*first, "trains: false\n");
  start(*second, "trains: false\n");
  start(trains, "serves: false\n");
  const auto session = demand(client::Session::open(session_options()));
  for (const std::uint64_t seed : {1, 2}) {
    const auto job = demand(session->submit_measurements("cell-7", fmt::format("learned-{}", seed),
                                                         virtual_batch_csv(60, seed)));
    static_cast<void>(demand(session->wait_for_job(job, kLimit, nullptr)));
  }
  trains.kill();
}

client::SessionOptions FailingOver::session_options() const {
  client::SessionOptions options = first->session_options();
  options.server_ports.push_back(second->port());
  return options;
}

void FailingOver::start(Daemon& server, const std::string& keys) const {
  std::string text = read_file(server.config_path());
  const std::string own = "store: trammel.db";
  text.replace(text.find(own), own.size(), "store: '" + url + "'");
  static_cast<void>(
      demand(write_text_file(server.config_path(), text + keys).map([] { return true; })));
  server.start();
}

std::set<std::string> FailingOver::lost(const ChangeLoad& load) const {
  return load.not_in(lines_of(record.sql("SELECT id FROM batches")),
                     lines_of(record.sql("SELECT id FROM changes")));
}

std::string FailingOver::twice() const {
  std::string found = record.sql(
      "SELECT 'job of two batches: ' || job FROM batches GROUP BY job HAVING count(*) > 1;SELECT "
      "'made twice: ' || request FROM audit WHERE what = 'activate' GROUP BY request HAVING "
      "count(*) > 1");
  const AuditTrail trail = demand(read_audit(url, {}));
  if (trail.broken) found += sentence(*trail.broken);
  return found;
}

double FailingOver::until_served_elsewhere_s() const {
  const auto one = demand(client::Session::open(first->session_options()));
  const auto other = demand(client::Session::open(second->session_options()));
  client::CallContext context;
  context.cell = "cell-7";
  client::ChangeOptions forced;
  forced.force = true;
  const auto served = [&] {
    return demand(other->predict_error(context, virtual_joints(1, 7))).model.version;
  };
  const int version = demand(one->activate("cell-7", served() == 1 ? 2 : 1, forced));
  const auto begin = std::chrono::steady_clock::now();
  std::chrono::duration<double> passed{0};
  for (bool is_served = false; !is_served && passed < kLimit;) {
    is_served = served() == version;
    passed = std::chrono::steady_clock::now() - begin;
  }
  return passed.count();
}

}  // namespace trammel::test
