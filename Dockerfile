# Everything from Debian's own packages: one solver stack, built and tested together. DEBIAN=sid builds too.
# runtime: what a solve needs; environment: and what tests, benchmarks and types need (./env); last: with the package.
ARG DEBIAN=trixie
FROM debian:${DEBIAN}-slim AS runtime

# libopenblas0-pthread: python3-dolfinx alone brings the reference BLAS, which factorises five times slower.
# gcc, g++, python3-dev: FFCx compiles each form on first use.
# pyvista, xvfb, libgl1-mesa-dri: pictures of bodies in 3D, and a display without a screen that VTK draws on.
# Check-Valid-Until: a mirror of sid may lag a few days behind its validity; the signatures are checked all the same.
# No manuals and no translations, and no packages once they are installed: half a gigabyte that nothing here reads.
RUN echo 'Acquire::Check-Valid-Until "false";' > /etc/apt/apt.conf.d/99lagging-mirror \
 && printf 'path-exclude=/usr/share/%s/*\n' doc man info locale > /etc/dpkg/dpkg.cfg.d/99small \
 && apt-get update -q \
 && DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends \
        python3-dolfinx python3-dolfinx-real python3-petsc4py-real libopenblas0-pthread \
        openmpi-bin python3-mpi4py \
        gmsh python3-gmsh python3-meshio python3-h5py \
        python3-numpy python3-scipy python3-pydantic python3-jinja2 \
        python3-matplotlib fonts-dejavu-core fonts-dejavu-extra python3-pyvista xvfb libgl1-mesa-dri \
        python3-cffi python3-dev gcc g++ libc6-dev \
 && apt-get clean \
 && rm -rf /var/lib/apt/lists/*

# Ranks may outnumber cores, and none is tied to one: two runs side by side would both sit on the first core.
# Open MPI 5 and 6 each read a file and names of their own.
RUN printf '%s\n' 'rmaps_default_mapping_policy = :oversubscribe' 'hwloc_default_binding_policy = none' \
        >> /etc/openmpi/prte-mca-params.conf \
 && mkdir -p /etc/prrte \
 && printf '%s\n' 'mapby = :oversubscribe' 'bindto = none' >> /etc/prrte/prte-mca-params.conf \
 && readlink -f /usr/lib/*-linux-gnu/libblas.so.3 | grep openblas \
 && python3 -B -c 'import dolfinx, petsc4py, gmsh, meshio, h5py; print(dolfinx.__version__, petsc4py.__version__)'

# Without the choice of transports Open MPI warns about networks that one machine does not need.
# HOME: the image runs as any user, with or without an entry in /etc/passwd.
ENV OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_btl=self,sm \
    OMP_NUM_THREADS=1 MPLBACKEND=Agg HOME=/tmp XDG_CACHE_HOME=/tmp/.cache


FROM runtime AS environment

# nbclient, ipykernel: the tests execute the tutorial; getfem, calculix-ccx: rivals in the benchmarks
# (trixie has no calculix-ccx, sid has).
# The command is the checkout's own, for as long as the package is not installed (./env sets PYTHONPATH).
RUN apt-get update -q \
 && DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends \
        python3-pytest python3-pytest-timeout python3-pytest-xdist python3-hypothesis python3-cvxopt mypy \
        python3-jsonschema python3-nbclient python3-nbformat python3-ipykernel python3-tomli-w \
        python3-getfem $(apt-cache --names-only search '^calculix-ccx$' | cut -d' ' -f1) python3-pip python3-setuptools make \
 && apt-get clean \
 && rm -rf /var/lib/apt/lists/* \
 && printf '#!/bin/sh\nexec python3 -m signorini_fx "$@"\n' > /usr/local/bin/signorini-fx \
 && chmod 755 /usr/local/bin/signorini-fx


FROM environment AS package

COPY . /src
RUN cd /src && pip install --no-index --no-deps --no-build-isolation --no-cache-dir --prefix /package .


FROM runtime

COPY --from=package /package/local /usr/local
COPY demos/scenes /opt/signorini_fx/demos/scenes
RUN useradd --uid 1000 signorini && mkdir -m 1777 /results
USER 1000
WORKDIR /results
ENTRYPOINT ["signorini-fx"]
CMD ["solve", "/opt/signorini_fx/demos/scenes/example1_tresca.toml", "--out", "/results"]
