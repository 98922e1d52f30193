#pragma once

#include <string>

#include "server/base/result.h"

/// DDS-Security: who a participant is, and what it may do. A folder holds what one participant
/// needs, under the names that ROS 2 gives these files: `identity_ca.cert.pem` (behind it
/// revocation lists, where there are some), `cert.pem`, `key.pem`, `permissions_ca.cert.pem`,
/// `governance.p7s`, `permissions.p7s`.
namespace trammel::wire {

struct Security {
  std::string folder;
  std::string subject;  ///< of the certificate, as RFC 2253 writes it: `CN=line-3,O=Trammel`
  std::string
      role;  ///< that deploy/security/keys gave it; empty: its permissions are not from there
  bool signs = false;  ///< by the plant's rules each message is signed, so that nobody else can
                       ///< speak for a participant
};

/// Looks at the files before the library does, which gives no reasons. Refuses (kRefused) a file
/// that is missing or cannot be read, a key that others may read, a certificate that has expired,
/// is not valid yet, is not of this authority, was revoked or has another key, and rules that were
/// not signed by the authority of the permissions, or whose permissions are for another subject,
/// have expired or are not valid yet.
[[nodiscard]] Result<Security> read_security(const std::string& folder);

/// Checks that a service may have these permissions: those of another role than `server` let it
/// answer nothing, and the library would say so of one of its topics only. Permissions that are not
/// from deploy/security/keys may be anything.
[[nodiscard]] Status check_serves(const Security& security);

/// The subject of the certificate that a participant has shown, as RFC 2253 writes it. `claimed`:
/// what its identity token says (`dds.cert.sn`), which nobody has checked. `participant`: the 12
/// octets of its GUID, which begin with a hash of the subject that the library has held against the
/// certificate. Empty: the two do not fit.
[[nodiscard]] std::string confirmed_subject(const std::string& claimed,
                                            const std::string& participant);

}  // namespace trammel::wire
