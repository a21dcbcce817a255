#include "timestamp/certificate_pool.h"

#include "timestamp/certificate_pool_state.h"

namespace kiroku::timestamp {

CertificatePool::CertificatePool() : state_(std::make_unique<State>()) {}
CertificatePool::~CertificatePool() = default;

}  // namespace kiroku::timestamp
