# EVENTGAN_PORTABLE: OpenCV, HDF5 and matio from Debian's archives (.a), of which the linker takes what is used. The shared ones
# load all that any of their functions may need: OpenCV's module video, for one optical flow, LLVM or protobuf; HDF5 curl with
# GnuTLS, Kerberos and LDAP; OpenCV's core OpenGL and Fortran. LAPACK stays, for calibration.
foreach(name IN ITEMS opencv_core opencv_imgproc opencv_video matio lapack_pic blas)
  find_library(EVENTGAN_STATIC_${name} lib${name}.a PATH_SUFFIXES blas REQUIRED)
  add_library(static_${name} STATIC IMPORTED)
  set_target_properties(static_${name} PROPERTIES IMPORTED_LOCATION ${EVENTGAN_STATIC_${name}})
endforeach()

# Objects, which the linker takes before it looks into an archive.
add_library(eventgan_stand_ins OBJECT docker/wheel/stand_ins.c)
set_target_properties(eventgan_stand_ins PROPERTIES POSITION_INDEPENDENT_CODE ON)
target_link_libraries(static_opencv_core INTERFACE
  $<TARGET_OBJECTS:eventgan_stand_ins> static_lapack_pic TBB::tbb ZLIB::ZLIB Threads::Threads ${CMAKE_DL_LIBS})
target_link_libraries(static_lapack_pic INTERFACE static_blas)
target_link_libraries(static_opencv_imgproc INTERFACE static_opencv_core)
target_link_libraries(static_opencv_video INTERFACE static_opencv_imgproc)
set(opencv static_opencv_imgproc static_opencv_core)
set(EVENTGAN_OPENCV_VIDEO static_opencv_video)

set(hdf5)
foreach(library IN LISTS HDF5_C_LIBRARIES)
  get_filename_component(folder ${library} DIRECTORY)
  if(library MATCHES "/libhdf5[^/]*\\.so$")
    string(REGEX REPLACE "so$" "a" library ${library})
  elseif(library MATCHES "/libsz\\.so$")
    set(library ${folder}/libsz.a ${folder}/libaec.a)
  elseif(library MATCHES "/lib(curl|crypto|ssl)\\.so$")
    continue()  # HDF5's files in the cloud
  endif()
  list(APPEND hdf5 ${library})
endforeach()
set(HDF5_C_LIBRARIES ${hdf5})
target_link_libraries(static_matio INTERFACE ${hdf5})
set_target_properties(PkgConfig::matio PROPERTIES INTERFACE_LINK_LIBRARIES "static_matio")

add_link_options(-Wl,--gc-sections,--no-undefined)
set(CMAKE_INSTALL_RPATH "$ORIGIN" ${ffmpeg_LIBRARY_DIRS})  # the weights' library, and FFmpeg's
