// The functions of OpenGL 4.5 that pictures are made with, as a table: software and graphics processors each
// bring their own, and nothing is linked. Plain data.
#pragma once

#include <GL/glcorearb.h>
#include <functional>
#include <string>

namespace kiroku::sim {

// clang-format off
#define KIROKU_GL_FUNCTIONS(X)                                              \
  X(PFNGLATTACHSHADERPROC, AttachShader)                                    \
  X(PFNGLBEGINQUERYPROC, BeginQuery)                                        \
  X(PFNGLBINDBUFFERBASEPROC, BindBufferBase)                                \
  X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                              \
  X(PFNGLBINDIMAGETEXTUREPROC, BindImageTexture)                            \
  X(PFNGLBINDTEXTUREUNITPROC, BindTextureUnit)                              \
  X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                              \
  X(PFNGLBLENDFUNCPROC, BlendFunc)                                          \
  X(PFNGLBLITNAMEDFRAMEBUFFERPROC, BlitNamedFramebuffer)                    \
  X(PFNGLCHECKNAMEDFRAMEBUFFERSTATUSPROC, CheckNamedFramebufferStatus)      \
  X(PFNGLCLEARNAMEDFRAMEBUFFERFVPROC, ClearNamedFramebufferfv)              \
  X(PFNGLCLEARNAMEDFRAMEBUFFERUIVPROC, ClearNamedFramebufferuiv)            \
  X(PFNGLCLIENTWAITSYNCPROC, ClientWaitSync)                                \
  X(PFNGLCOMPILESHADERPROC, CompileShader)                                  \
  X(PFNGLCREATEBUFFERSPROC, CreateBuffers)                                  \
  X(PFNGLCREATEFRAMEBUFFERSPROC, CreateFramebuffers)                        \
  X(PFNGLCREATEPROGRAMPROC, CreateProgram)                                  \
  X(PFNGLCREATEQUERIESPROC, CreateQueries)                                  \
  X(PFNGLCREATESHADERPROC, CreateShader)                                    \
  X(PFNGLCREATETEXTURESPROC, CreateTextures)                                \
  X(PFNGLCREATEVERTEXARRAYSPROC, CreateVertexArrays)                        \
  X(PFNGLCULLFACEPROC, CullFace)                                            \
  X(PFNGLDELETEBUFFERSPROC, DeleteBuffers)                                  \
  X(PFNGLDELETEFRAMEBUFFERSPROC, DeleteFramebuffers)                        \
  X(PFNGLDELETEPROGRAMPROC, DeleteProgram)                                  \
  X(PFNGLDELETEQUERIESPROC, DeleteQueries)                                  \
  X(PFNGLDELETESHADERPROC, DeleteShader)                                    \
  X(PFNGLDELETESYNCPROC, DeleteSync)                                        \
  X(PFNGLDELETETEXTURESPROC, DeleteTextures)                                \
  X(PFNGLDELETEVERTEXARRAYSPROC, DeleteVertexArrays)                        \
  X(PFNGLDEPTHFUNCPROC, DepthFunc)                                          \
  X(PFNGLDISABLEPROC, Disable)                                              \
  X(PFNGLDISPATCHCOMPUTEPROC, DispatchCompute)                              \
  X(PFNGLDRAWARRAYSPROC, DrawArrays)                                        \
  X(PFNGLENABLEPROC, Enable)                                                \
  X(PFNGLENDQUERYPROC, EndQuery)                                            \
  X(PFNGLFENCESYNCPROC, FenceSync)                                          \
  X(PFNGLFLUSHPROC, Flush)                                                  \
  X(PFNGLGETERRORPROC, GetError)                                            \
  X(PFNGLGETINTEGER64VPROC, GetInteger64v)                                  \
  X(PFNGLGETINTEGERVPROC, GetIntegerv)                                      \
  X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)                          \
  X(PFNGLGETPROGRAMIVPROC, GetProgramiv)                                    \
  X(PFNGLGETQUERYOBJECTUIVPROC, GetQueryObjectuiv)                          \
  X(PFNGLGETSHADERINFOLOGPROC, GetShaderInfoLog)                            \
  X(PFNGLGETSHADERIVPROC, GetShaderiv)                                      \
  X(PFNGLGETSTRINGPROC, GetString)                                          \
  X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)                        \
  X(PFNGLLINKPROGRAMPROC, LinkProgram)                                      \
  X(PFNGLMAPNAMEDBUFFERRANGEPROC, MapNamedBufferRange)                      \
  X(PFNGLMEMORYBARRIERPROC, MemoryBarrier)                                  \
  X(PFNGLNAMEDBUFFERDATAPROC, NamedBufferData)                              \
  X(PFNGLNAMEDBUFFERSTORAGEPROC, NamedBufferStorage)                        \
  X(PFNGLNAMEDBUFFERSUBDATAPROC, NamedBufferSubData)                        \
  X(PFNGLNAMEDFRAMEBUFFERDRAWBUFFERPROC, NamedFramebufferDrawBuffer)        \
  X(PFNGLNAMEDFRAMEBUFFERDRAWBUFFERSPROC, NamedFramebufferDrawBuffers)      \
  X(PFNGLNAMEDFRAMEBUFFERREADBUFFERPROC, NamedFramebufferReadBuffer)        \
  X(PFNGLNAMEDFRAMEBUFFERTEXTUREPROC, NamedFramebufferTexture)              \
  X(PFNGLNAMEDFRAMEBUFFERTEXTURELAYERPROC, NamedFramebufferTextureLayer)    \
  X(PFNGLPIXELSTOREIPROC, PixelStorei)                                      \
  X(PFNGLPROGRAMUNIFORM1FPROC, ProgramUniform1f)                            \
  X(PFNGLPROGRAMUNIFORM1IPROC, ProgramUniform1i)                            \
  X(PFNGLPROGRAMUNIFORM3FPROC, ProgramUniform3f)                            \
  X(PFNGLPROGRAMUNIFORM4FPROC, ProgramUniform4f)                            \
  X(PFNGLPROGRAMUNIFORM4IPROC, ProgramUniform4i)                            \
  X(PFNGLREADPIXELSPROC, ReadPixels)                                        \
  X(PFNGLSCISSORPROC, Scissor)                                              \
  X(PFNGLSHADERSOURCEPROC, ShaderSource)                                    \
  X(PFNGLTEXTUREPARAMETERFVPROC, TextureParameterfv)                        \
  X(PFNGLTEXTUREPARAMETERIPROC, TextureParameteri)                          \
  X(PFNGLTEXTURESTORAGE1DPROC, TextureStorage1D)                            \
  X(PFNGLTEXTURESTORAGE2DPROC, TextureStorage2D)                            \
  X(PFNGLTEXTURESTORAGE3DPROC, TextureStorage3D)                            \
  X(PFNGLTEXTURESUBIMAGE1DPROC, TextureSubImage1D)                          \
  X(PFNGLTEXTURESUBIMAGE2DPROC, TextureSubImage2D)                          \
  X(PFNGLTEXTURESUBIMAGE3DPROC, TextureSubImage3D)                          \
  X(PFNGLUSEPROGRAMPROC, UseProgram)                                        \
  X(PFNGLVIEWPORTPROC, Viewport)
// clang-format on

/// Names as in the specification, without "gl".
struct GlFunctions {
#define KIROKU_GL_DECLARE(Type, Name) Type Name = nullptr;
  KIROKU_GL_FUNCTIONS(KIROKU_GL_DECLARE)
#undef KIROKU_GL_DECLARE
};

/// Address of a function by its full name, or nullptr.
using GlLoader = std::function<void*(const char* name)>;
/// kiroku::Error that names the first function that is missing; `from` says where: "libOSMesa.so.8".
GlFunctions load_gl(const GlLoader& loader, const std::string& from);

/// kiroku::Error if a call of OpenGL failed since the last check: "cannot <what>: OpenGL ran out of memory".
void check_gl(const GlFunctions& gl, const std::string& what);

}  // namespace kiroku::sim
