# Serves a task to learners on other machines: docs/guides/remote.md
#     docker build -t veca .
#     docker run -p 5555:5555 -v "$PWD/veca_keys:/keys" veca keys=/keys new_client=trainer
#     docker run -p 5555:5555 -v "$PWD/veca_keys:/keys" veca
#     docker run -p 5555:5555 -v "$PWD/veca_keys:/keys" veca +task=TurnBaby worlds=4 keys=/keys \
#         address=tcp://0.0.0.0:5555
FROM python:3.11-slim
COPY pyproject.toml hatch_build.py README.md LICENSE /veca/
COPY veca_marl /veca/veca_marl
COPY hydra_plugins /veca/hydra_plugins
COPY conf /veca/conf
COPY scripts /veca/scripts
RUN pip install --no-cache-dir "/veca[remote]"
RUN useradd --create-home veca
USER veca
WORKDIR /home/veca
RUN python /veca/scripts/compile_kernels.py
EXPOSE 5555
ENTRYPOINT ["python", "-m", "veca_marl.serve"]
CMD ["+task=KickTheBall", "worlds=8", "address=tcp://0.0.0.0:5555", "keys=/keys"]
