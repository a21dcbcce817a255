#include "http/server_tls.h"

#include <boost/asio/buffer.hpp>
#include <boost/system/system_error.hpp>
#include <openssl/ssl.h>

#include "base/error.h"

namespace kiroku::http {

namespace asio = boost::asio;

asio::ssl::context server_tls(const std::string& certificate_pem, ByteView key_pem) {
  asio::ssl::context tls(asio::ssl::context::tls_server);
  try {
    tls.use_certificate_chain(asio::buffer(certificate_pem));
    tls.use_private_key(asio::buffer(key_pem.data(), key_pem.size()), asio::ssl::context::pem);
  } catch (const boost::system::system_error& error) {
    throw UsageError("cannot use the certificate or its key: " + error.code().message() +
                     "; both must be PEM, belong together, and the key have no passphrase");
  }
  SSL_CTX* const native = tls.native_handle();
  SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
  SSL_CTX_set_cipher_list(native, "ECDHE+AESGCM:ECDHE+CHACHA20");
  SSL_CTX_set_options(native, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION |
                                  SSL_OP_CIPHER_SERVER_PREFERENCE | SSL_OP_NO_TICKET |
                                  SSL_OP_CLEANSE_PLAINTEXT);
  SSL_CTX_set_session_cache_mode(native, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_mode(native, SSL_MODE_RELEASE_BUFFERS);
  return tls;
}

asio::ssl::context server_tls(const std::string& certificate_pem, ByteView key_pem,
                              const std::string& client_authority_pem) {
  asio::ssl::context tls = server_tls(certificate_pem, key_pem);
  try {
    tls.add_certificate_authority(asio::buffer(client_authority_pem));
    tls.set_verify_mode(asio::ssl::verify_peer);
  } catch (const boost::system::system_error& error) {
    throw UsageError("cannot use the authority of clients' certificates: " + error.code().message());
  }
  return tls;
}

}  // namespace kiroku::http
