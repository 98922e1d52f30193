#include "clients/cam/urscript/loads.h"

#include <fmt/format.h>

#include <utility>

#include "clients/cam/number_text.h"

namespace trammel::cam::urscript {

namespace {

/// `[0, 0, 0.1]` from a piece on; empty: it is not constant.
std::optional<Vector3> centre_at(const std::vector<Piece>& pieces, std::size_t at) {
  if (!pieces[at].is("[")) return std::nullopt;
  std::vector<double> centre;
  for (++at; at < pieces.size() && !pieces[at].is("]"); ++at) {
    if (pieces[at].kind == Piece::Kind::kNumber)
      centre.push_back(read_number(pieces[at].text).value_or(WrittenNumber{}).value);
    else if (!pieces[at].is(","))
      return std::nullopt;
  }
  if (centre.size() != 3) return std::nullopt;
  return Vector3(centre[0], centre[1], centre[2]);
}

}  // namespace

std::size_t Loads::add(Load load) {
  for (std::size_t k = 1; k < all_.size(); ++k) {
    const Load& known = all_[k];
    const bool same =
        known.load.has_value() == load.load.has_value() &&
        (!load.load || (known.load->mass == load.load->mass && known.load->p_F == load.load->p_F &&
                        known.load->has_centre == load.load->has_centre));
    if (same && known.why_not == load.why_not) return k;
  }
  all_.push_back(std::move(load));
  return all_.size() - 1;
}

std::size_t Loads::set(const std::vector<Piece>& pieces, std::size_t at, std::size_t before,
                       const std::string& file) {
  const std::string where = fmt::format("{} ({} line {})", pieces[at].text, file, pieces[at].line);
  Load load{where, std::nullopt, ""};
  StatedLoad stated;
  stated.has_centre = false;
  const std::optional<StatedLoad> known = all_[before].load;
  std::size_t next = at + 2;
  bool constant = true;
  if (pieces[at].is("set_payload_cog")) {
    if (!known) return before;
    stated = *known;
  } else {
    if (known && pieces[at].is("set_payload_mass")) stated = *known;
    constant = next + 1 < pieces.size() && pieces[next].kind == Piece::Kind::kNumber &&
               (pieces[next + 1].is(",") || pieces[next + 1].is(")"));
    if (constant) stated.mass = read_number(pieces[next].text).value_or(WrittenNumber{}).value;
    next += 2;
  }
  if (constant && !pieces[at].is("set_payload_mass") && next < pieces.size() &&
      pieces[next - 1].text != ")") {
    const auto centre = centre_at(pieces, next);
    constant = centre.has_value();
    if (centre) stated.p_F = *centre;
    stated.has_centre = true;
  }
  if (constant)
    load.load = stated;
  else
    load.why_not = where + " is not constant";
  return add(std::move(load));
}

}  // namespace trammel::cam::urscript
